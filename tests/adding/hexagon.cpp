// SPDX-License-Identifier: Apache-2.0
/// A shape: an upright hexagonal column. docs/adding.md shows it; adding_test.cpp asks it.
#include <Eigen/Geometry>
#include <cmath>

#include "adding/examples.h"
#include "blindcorner/forward/constants.h"
#include "forward/scene/shapes/shape_parts.h"

namespace blindcorner {
namespace {

// [shape]
/// Six walls, and two caps of three rhombi each; a FlatGeometry derives all the rest from its
/// sides.
class Hexagon final : public FlatGeometry {
 public:
  explicit Hexagon(const HexagonShape& shape) : edge_(shape.edge), half_(shape.height / 2) {}

  const char* name() const override { return "hexagon"; }
  Anchor default_anchor() const override { return Anchor::base; }  // it stands
  bool closed() const override { return true; }
  double yaw_period() const override { return kPi / 3; }
  double reach(double below) const override { return std::hypot(edge_, half_ + below); }

 protected:
  std::vector<Side> sides() const override {
    std::vector<Side> sides;
    const Eigen::Vector3d up(0, 0, half_);
    for (int k = 0; k < 6; ++k) {
      const Eigen::Vector3d a = corner(k), b = corner(k + 1);
      sides.push_back({(a + b) / 2, (b - a) / 2, up});  // outward: along the edge x up
    }
    for (int k = 0; k < 6; k += 2) {
      const Eigen::Vector3d u = corner(k) / 2, v = corner(k + 2) / 2;
      sides.push_back({u + v + up, u, v});
      sides.push_back({u + v - up, v, u});
    }
    return sides;
  }
  Eigen::Vector3d half_edges() const override { return {edge_, edge_ * std::cos(kPi / 6), half_}; }

 private:
  Eigen::Vector3d corner(int k) const {
    return {edge_ * std::cos(k * kPi / 3), edge_ * std::sin(k * kPi / 3), 0};
  }

  double edge_, half_;  ///< m, the last half the height
};
// [/shape]

}  // namespace

std::unique_ptr<const ShapeGeometry> HexagonShape::geometry() const {
  return std::make_unique<Hexagon>(*this);
}

}  // namespace blindcorner
