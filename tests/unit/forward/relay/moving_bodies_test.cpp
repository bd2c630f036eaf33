// SPDX-License-Identifier: Apache-2.0
#include "forward/relay/moving_bodies.h"

#include <gtest/gtest.h>

#include <random>

#include "forward/relay/ray_scene.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Share of the patch |y| <= 1 m, |z| <= 0.6 m of the wall x = 0 that rays from the point reach.
double open_share(const RayScene& bodies, const Vector3d& from) {
  constexpr int kSteps = 200;
  int open = 0;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      const Vector3d to(0, 2 * (i + 0.5) / kSteps - 1, 0.6 * (2 * (j + 0.5) / kSteps - 1));
      if (!bodies.blocked(from, to)) ++open;
    }
  }
  return static_cast<double>(open) / (kSteps * kSteps);
}

// What stands for a body as seen from a point must hide as much as the body does, for every shape
// that there is: the shadow's area by rays through the body's triangles and by clipped faces. The
// cylinder is taller than the patch, because what its rims hide besides its side is left out.
TEST(MovingBodiesTest, HideAsMuchAsTheBodyDoes) {
  const auto wedge = make_mesh({{0, 0, 0}, {0.3, 0, 0}, {0, 0.4, 0}, {0, 0, 0.5}},
                               {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}});
  const std::vector<Shape> shapes = {RectangleShape{0.4, 0.3}, BoxShape{{0.2, 0.3, 0.4}},
                                     SphereShape{0.15}, CylinderShape{0.12, 2.0},
                                     MeshShape{wedge, false}};
  ASSERT_EQ(shapes.size(), std::variant_size_v<Shape>);
  for (const Shape& shape : shapes) {
    HiddenObject object;
    object.shape = shape;
    Placement placement;
    placement.position = Vector3d(0.8, 0.05, 0);
    placement.yaw = 0.5;
    placement.size = 1.2;
    MovingBodies bodies;
    EXPECT_TRUE(bodies.empty());
    bodies.add(object, placement);
    EXPECT_FALSE(bodies.empty());
    const RayScene rays({triangulate(shape, object_to_world(shape, object.anchor, placement),
                                     placement.size, 200)});
    for (const double side : {-0.1, 0.0, 0.15}) {
      const Vector3d viewpoint(2, side, 0);
      std::vector<OccluderFace> faces;
      bodies.faces_seen_from(viewpoint, faces);
      const double share = ShadowView(faces, viewpoint)
                               .see(Vector3d::Zero(), Vector3d(0, 1, 0), Vector3d(0, 0, 0.6))
                               .fraction;
      const double exact = open_share(rays, viewpoint);
      ASSERT_LT(exact, 0.95) << shape_name(shape);
      // Rays on a grid of 0.01 m x 0.006 m err by half a step along the shadow's rim, 2 m at most
      // of 2.4 m^2: 0.004 if all errors had one sign.
      EXPECT_NEAR(share, exact, 0.004) << shape_name(shape);
    }
  }
}

/// A ball and, behind it, another, so that some patches have several outlines in front of them.
MovingBodies two_balls() {
  HiddenObject object;
  object.shape = SphereShape{0.15};
  MovingBodies bodies;
  for (const double x : {0.8, 0.5}) {
    Placement placement;
    placement.position = Vector3d(x, 0.05, 0.1 * x);
    bodies.add(object, placement);
  }
  return bodies;
}

// One octagon is clipped as what it hides, its three parts as what they leave: two ways to the same
// visible part.
TEST(MovingBodiesTest, AnOutlineHidesWhatItsPartsDo) {
  const MovingBodies bodies = two_balls();
  const Vector3d viewpoint(2, 0, 0);
  std::vector<OccluderFace> parts;
  bodies.faces_seen_from(viewpoint, parts);
  ASSERT_EQ(parts.size(), 6U);
  const ShadowView by_parts(parts, viewpoint);
  ShadowView whole({}, viewpoint);
  bodies.cast(viewpoint, whole);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> at(-0.5, 0.5), edge(0.01, 0.3);
  int partial = 0;
  for (int i = 0; i < 500; ++i) {
    const Vector3d center(0, at(random), at(random));
    const Vector3d u(0.01, edge(random), 0), v(0, 0.02, edge(random));
    const VisiblePart expected = by_parts.see(center, u, v);
    const VisiblePart found = whole.see(center, u, v);
    EXPECT_NEAR(found.fraction, expected.fraction, 1e-12);
    // Areas are right to some 1e-16 of the whole, so a sliver's centre is not.
    EXPECT_LT(expected.fraction * (found.shift - expected.shift).norm(), 1e-12);
    partial += expected.fraction > 0 && expected.fraction < 1 ? 1 : 0;
  }
  EXPECT_GT(partial, 100);
}

// A patch across the seam of two parts is hidden by neither of them alone.
TEST(MovingBodiesTest, AnOutlineHidesABallBehindItAtFirstSight) {
  const MovingBodies bodies = two_balls();
  const Vector3d viewpoint(2, 0, 0);
  ShadowView whole({}, viewpoint);
  bodies.cast(viewpoint, whole);
  // On the wall, on the line from the viewpoint through the first ball's centre.
  const Vector3d behind = viewpoint + (Vector3d(0.8, 0.05, 0.08) - viewpoint) / 0.6;
  EXPECT_EQ(whole.sight(behind, 0.1), ShadowView::Sight::hidden);
  EXPECT_EQ(whole.sight({0, 0.7, 0}, 0.1), ShadowView::Sight::clear);
}

}  // namespace
}  // namespace blindcorner
