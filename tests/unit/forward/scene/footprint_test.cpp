// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/scene/footprint.h"

#include <gtest/gtest.h>

#include <cmath>

#include "blindcorner/forward/constants.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

Placement some_placement() {
  Placement placement;
  placement.position = Vector3d(0.4, -1.3, 0.8);
  placement.yaw = 0.7;
  placement.size = 1.5;
  return placement;
}

/// Signed area, m^2: positive when the corners run counter-clockwise.
double area(const Footprint& corners) {
  double twice = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vector2d& a = corners[i];
    const Vector2d& b = corners[(i + 1) % corners.size()];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return twice / 2;
}

TEST(FootprintTest, IsWhatTheShapeCoversOfThePlan) {
  const Placement placement = some_placement();
  const double scale = placement.size * placement.size;
  const Footprint box = footprint(BoxShape{{2.0, 0.6, 1.8}}, Anchor::base, placement);
  EXPECT_EQ(box.size(), 4U);
  EXPECT_NEAR(area(box), scale * 1.2, 1e-12);
  const double inscribed = 24 * std::sin(2 * kPi / 48);  // area of 48 corners on a unit circle
  const Footprint cylinder = footprint(CylinderShape{0.2, 1.7}, Anchor::base, placement);
  EXPECT_NEAR(area(cylinder), scale * 0.04 * inscribed, 1e-12);
  const Footprint sphere = footprint(SphereShape{0.25}, Anchor::center, placement);
  EXPECT_NEAR(area(sphere), scale * 0.0625 * inscribed, 1e-12);
  for (const Vector2d& corner : sphere) {
    EXPECT_NEAR((corner - placement.position.head<2>()).norm(), 1.5 * 0.25, 1e-12);
  }
  const auto triangle = make_mesh({{0, 0, 0}, {1, 0, 0.5}, {0, 1, 0.5}}, {{0, 1, 2}});
  EXPECT_NEAR(area(footprint(MeshShape{triangle, true}, Anchor::center, placement)), scale / 2,
              1e-12);
}

TEST(FootprintTest, OfAnUprightRectangleIsItsEdge) {
  const Placement placement = some_placement();
  const Footprint edge = footprint(RectangleShape{0.4, 0.6}, Anchor::center, placement);
  ASSERT_EQ(edge.size(), 2U);
  EXPECT_LT(((edge[0] + edge[1]) / 2 - placement.position.head<2>()).norm(), 1e-12);
  const Vector2d along = edge[1] - edge[0];
  EXPECT_NEAR(along.norm(), 1.5 * 0.4, 1e-12);
  EXPECT_NEAR(along.dot(Vector2d(std::cos(0.7), std::sin(0.7))), 0, 1e-12) << "normal at yaw 0.7";
}

// Whoever draws or rasterises many placements asks once.
TEST(FootprintTest, FollowsThePlacementRigidly) {
  const Placement placement = some_placement();
  const Eigen::Rotation2Dd turn(placement.yaw);
  const Shape shape = BoxShape{{2.0, 0.6, 1.8}};
  const Footprint moved = footprint(shape, Anchor::base, placement);
  for (const Vector2d& home : footprint(shape, Anchor::base, Placement{})) {
    const Vector2d expected = placement.position.head<2>() + placement.size * (turn * home);
    double nearest = 1e300;
    for (const Vector2d& corner : moved) nearest = std::min(nearest, (corner - expected).norm());
    EXPECT_LT(nearest, 1e-12);
  }
}

}  // namespace
}  // namespace blindcorner
