// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "forward/scene/shapes/shape_parts.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

class Box final : public FlatGeometry {
 public:
  explicit Box(const BoxShape& shape) : half_(shape.size / 2) {}

  const char* name() const override { return "box"; }
  Anchor default_anchor() const override { return Anchor::base; }
  bool closed() const override { return true; }
  double yaw_period() const override {
    return 2 * std::abs(half_.x() - half_.y()) < 1e-12 ? kPi / 2 : kPi;
  }
  double reach(double below) const override {
    return std::hypot(half_.x(), half_.y(), half_.z() + below);
  }

 private:
  std::vector<Side> sides() const override {
    std::vector<Side> sides;
    for (int axis = 0; axis < 3; ++axis) {
      const int b = (axis + 1) % 3;
      const int c = (axis + 2) % 3;
      for (const double sign : {1.0, -1.0}) {
        sides.push_back({Vector3d::Unit(axis) * (sign * half_[axis]), Vector3d::Unit(b) * half_[b],
                         Vector3d::Unit(c) * (sign * half_[c])});
      }
    }
    return sides;
  }
  Vector3d half_edges() const override { return half_; }

  Vector3d half_;  ///< m
};

}  // namespace

std::unique_ptr<const ShapeGeometry> BoxShape::geometry() const {
  return std::make_unique<Box>(*this);
}

}  // namespace blindcorner
