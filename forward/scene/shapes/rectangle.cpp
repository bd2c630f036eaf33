// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "forward/scene/shapes/shape_parts.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

class Rectangle final : public FlatGeometry {
 public:
  explicit Rectangle(const RectangleShape& shape) : shape_(shape) {}

  const char* name() const override { return "rectangle"; }
  Anchor default_anchor() const override { return Anchor::center; }
  bool closed() const override { return false; }
  double yaw_period() const override { return 2 * kPi; }
  double reach(double below) const override {
    return std::hypot(shape_.width / 2, shape_.height / 2 + below);
  }

 private:
  std::vector<Side> sides() const override {
    return {
        {Vector3d::Zero(), Vector3d(0, shape_.width / 2, 0), Vector3d(0, 0, shape_.height / 2)}};
  }
  Vector3d half_edges() const override { return {0, shape_.width / 2, shape_.height / 2}; }

  RectangleShape shape_;
};

}  // namespace

std::unique_ptr<const ShapeGeometry> RectangleShape::geometry() const {
  return std::make_unique<Rectangle>(*this);
}

}  // namespace blindcorner
