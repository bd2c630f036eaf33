// SPDX-License-Identifier: Apache-2.0
#include "forward/relay/moving_bodies.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace blindcorner
