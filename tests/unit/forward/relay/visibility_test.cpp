// SPDX-License-Identifier: Apache-2.0
#include "forward/relay/visibility.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/transport/transport_plan.h"
#include "forward/relay/ray_scene.h"

namespace blindcorner {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Surface occluder(const Shape& shape, const Vector3d& center,
                 const Matrix3d& axes = Matrix3d::Identity()) {
  Surface surface;
  surface.shape = shape;
  surface.T_world_surface.linear() = axes;
  surface.T_world_surface.translation() = center;
  surface.occluder = true;
  return surface;
}

/// Patch that all tests look at: 2 m x 1.2 m on the wall x = 0.
struct Patch {
  Vector3d center = Vector3d::Zero();
  Vector3d half_u = Vector3d(0, 1, 0);
  Vector3d half_v = Vector3d(0, 0, 0.6);
};

VisiblePart see(const std::vector<Surface>& surfaces, const Vector3d& viewpoint,
                const Patch& patch = {}) {
  return ShadowView(occluder_faces(surfaces), viewpoint)
      .see(patch.center, patch.half_u, patch.half_v);
}

/// Each quad as a face of two triangles of a mesh.
MeshShape mesh_of(const std::vector<Quad>& quads) {
  std::vector<Vector3d> vertices;
  const auto index = [&](const Vector3d& corner) {
    const auto known = std::ranges::find(vertices, corner);
    const auto at = static_cast<int>(known - vertices.begin());
    if (known == vertices.end()) vertices.push_back(corner);
    return at;
  };
  std::vector<std::array<int, 3>> triangles;
  for (const Quad& q : quads) {
    triangles.push_back({index(q[0]), index(q[1]), index(q[2])});
    triangles.push_back({index(q[0]), index(q[2]), index(q[3])});
  }
  return {make_mesh(vertices, triangles), false};
}

// Faces of a body that encloses a volume count from outside only, whatever the body is made of: a
// viewpoint inside of it sees out.
TEST(VisibilityTest, ClosedMeshHidesWhatABoxHides) {
  const Shape box = BoxShape{{0.4, 0.5, 0.6}};
  const Shape mesh = mesh_of(flat_faces(box, Transform::Identity(), 1.0));
  ASSERT_TRUE(is_closed(mesh));
  for (const OccluderFace& face : occluder_faces({occluder(mesh, {1, 0, 0})})) {
    EXPECT_TRUE(face.one_sided);
  }
  for (const Vector3d& viewpoint : {Vector3d(2, 0.1, 0.2), Vector3d(1.1, 0.1, -0.1)}) {
    EXPECT_NEAR(see({occluder(mesh, {1, 0, 0})}, viewpoint).fraction,
                see({occluder(box, {1, 0, 0})}, viewpoint).fraction, 1e-12);
  }
}

// The visible part has closed forms when an edge passes through the middle: half, and its centre
// half way to the visible side.
TEST(VisibilityTest, HalfPlaneHidesHalf) {
  // Parallel to the wall, half way, y > 0 of it blocked far beyond the patch.
  const std::vector<Surface> surfaces = {occluder(RectangleShape{10, 10}, {1, 5, 0})};
  const VisiblePart part = see(surfaces, {2, 0, 0});
  EXPECT_NEAR(part.fraction, 0.5, 1e-12);
  EXPECT_LT((part.shift - Vector3d(0, -0.5, 0)).norm(), 1e-12);
  // Moving the viewpoint by d moves the shadow by -d: the lever is one.
  EXPECT_NEAR(see(surfaces, {2, 0.1, 0}).fraction, 0.45, 1e-12);
}

TEST(VisibilityTest, WindowOfShadowHasItsProjectedArea) {
  // A plate of 0.5 x 0.3 m half way casts a shadow of 1 x 0.6 m: a quarter of the patch.
  const VisiblePart part = see({occluder(RectangleShape{0.5, 0.3}, {1, 0, 0})}, {2, 0, 0});
  EXPECT_NEAR(part.fraction, 0.75, 1e-12);
  EXPECT_LT(part.shift.norm(), 1e-12);
}

TEST(VisibilityTest, WhatIsNotBetweenHidesNothing) {
  const RectangleShape big{10, 10};
  const Vector3d viewpoint(2, 0, 0);
  EXPECT_EQ(see({}, viewpoint).fraction, 1.0);
  EXPECT_EQ(see({occluder(big, {-0.5, 0, 0})}, viewpoint).fraction, 1.0) << "behind the patch";
  EXPECT_EQ(see({occluder(big, {2.5, 0, 0})}, viewpoint).fraction, 1.0) << "behind the viewpoint";
  EXPECT_EQ(see({occluder(RectangleShape{1, 1}, {1, 4, 0})}, viewpoint).fraction, 1.0) << "beside";
  EXPECT_EQ(see({occluder(big, {1, 0, 0})}, viewpoint).fraction, 0.0);
  // Seen edge on, a rectangle hides nothing.
  const Matrix3d sideways = Eigen::AngleAxisd(kPi / 2, Vector3d::UnitZ()).matrix();
  EXPECT_NEAR(see({occluder(RectangleShape{1, 5}, {1, 0, 0}, sideways)}, viewpoint).fraction, 1.0,
              1e-9);
  Surface not_blocking = occluder(big, {1, 0, 0});
  not_blocking.occluder = false;
  EXPECT_EQ(see({not_blocking}, viewpoint).fraction, 1.0);
}

// Shadows that overlap count once.
TEST(VisibilityTest, OverlappingShadowsCountOnce) {
  const Surface plate = occluder(RectangleShape{0.5, 0.3}, {1, 0, 0});
  const Surface shifted = occluder(RectangleShape{0.5, 0.3}, {1, 0.1, 0.05});
  const Vector3d viewpoint(2, 0, 0);
  EXPECT_NEAR(see({plate, plate}, viewpoint).fraction, 0.75, 1e-9);
  // Union of two 1 x 0.6 shadows 0.2, 0.1 apart: 2 * 0.6 - 0.8 * 0.5, over 2.4.
  EXPECT_NEAR(see({plate, shifted}, viewpoint).fraction, 1 - 0.8 / 2.4, 1e-9);
  EXPECT_NEAR(see({shifted, plate}, viewpoint).fraction, 1 - 0.8 / 2.4, 1e-9);
}

Matrix3d random_axes(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const Eigen::Quaterniond q(normal(random), normal(random), normal(random), normal(random));
  return q.normalized().toRotationMatrix();
}

// Independent check: rays from the viewpoint to 64 x 64 jittered points of the patch.
class RandomOccluders : public testing::TestWithParam<int> {};

TEST_P(RandomOccluders, FractionAndCentroidAgreeWithRays) {
  std::mt19937 random(static_cast<unsigned>(GetParam()));
  std::uniform_real_distribution<double> uniform(-1, 1);
  int partly = 0;
  for (int trial = 0; trial < 40; ++trial) {
    std::vector<Surface> surfaces;
    for (int i = 0; i < GetParam(); ++i) {
      const Vector3d center(1 + 0.3 * uniform(random), 0.6 * uniform(random),
                            0.5 * uniform(random));
      const double a = 0.35 + 0.25 * uniform(random);
      const double b = 0.35 + 0.25 * uniform(random);
      if (uniform(random) < 0) {
        surfaces.push_back(occluder(RectangleShape{a, b}, center, random_axes(random)));
      } else {
        // Boxes as scenes have them: upright.
        const Matrix3d yaw = Eigen::AngleAxisd(kPi * uniform(random), Vector3d::UnitZ()).matrix();
        surfaces.push_back(occluder(BoxShape{{a, b, 0.3}}, center, yaw));
      }
    }
    // Beyond the occluders, whose corners reach to x = 1.3 + 0.45.
    const Vector3d viewpoint(2.1 + 0.2 * uniform(random), uniform(random), 0.5 * uniform(random));
    const RayScene rays(surfaces);
    const Patch patch;
    constexpr int kSide = 64;
    int visible = 0;
    Vector3d moment = Vector3d::Zero();
    for (int i = 0; i < kSide; ++i) {
      for (int j = 0; j < kSide; ++j) {
        const double u = (2 * i + 1 + uniform(random)) / kSide - 1;
        const double v = (2 * j + 1 + uniform(random)) / kSide - 1;
        const Vector3d point = patch.center + u * patch.half_u + v * patch.half_v;
        if (rays.blocked(viewpoint, point)) continue;
        ++visible;
        moment += point - patch.center;
      }
    }
    const double fraction = static_cast<double>(visible) / (kSide * kSide);
    const VisiblePart part = see(surfaces, viewpoint);
    if (fraction > 0 && fraction < 1) ++partly;
    // Only strata that a shadow's edge crosses are random: at most 10 n kSide of them with edges
    // no longer than the patch, each with a variance of at most 1/4. Five standard deviations.
    const double sigma = std::sqrt(10.0 * GetParam() * kSide / 4) / (kSide * kSide);
    EXPECT_NEAR(part.fraction, fraction, 5 * sigma) << "trial " << trial;
    if (visible > 0) {
      EXPECT_LT((part.fraction * part.shift - moment / (kSide * kSide)).norm(), 5 * sigma * 1.2)
          << "trial " << trial;
    }
  }
  EXPECT_GT(partly, 20) << "too few shadow edges on the patch to prove anything";
}

INSTANTIATE_TEST_SUITE_P(Visibility, RandomOccluders, testing::Values(1, 2, 3, 5));

// A switch or a dropped polygon would show as a step: halving the way between viewpoints has to
// halve the largest change.
TEST(VisibilityTest, FractionIsContinuousAsTheViewpointMoves) {
  const Matrix3d turned = Eigen::AngleAxisd(0.6, Vector3d::UnitZ()).matrix();
  const std::vector<Surface> surfaces = {
      occluder(BoxShape{{0.3, 0.5, 0.6}}, {1, 0.1, 0}, turned),
      occluder(RectangleShape{0.7, 0.4}, {0.8, -0.2, 0.1}, turned.transpose()),
      occluder(BoxShape{{0.2, 0.2, 1.5}}, {1.2, -0.5, 0})};
  const auto largest_change = [&](int steps) {
    double largest = 0;
    double last = -1;
    Vector3d last_moment = Vector3d::Zero();
    for (int i = 0; i <= steps; ++i) {
      const double t = static_cast<double>(i) / steps;
      const VisiblePart part = see(surfaces, Vector3d(2 + 0.3 * t, -1.7 + 3.4 * t, 0.7 - t));
      const Vector3d moment = part.fraction * part.shift;
      if (last >= 0) {
        largest =
            std::max({largest, std::abs(part.fraction - last), (moment - last_moment).norm()});
      }
      last = part.fraction;
      last_moment = moment;
    }
    return largest;
  };
  const double coarse = largest_change(1000);
  const double fine = largest_change(32000);
  // The path is 3.6 m long; an edge's shadow moves at most about twice as fast as the viewpoint,
  // over at most 1.2 m height of the patch's 2.4 m^2, with some six moving edges.
  EXPECT_LT(fine, 6 * 2 * (3.6 / 32000) * 1.2 / 2.4);
  EXPECT_LT(fine, coarse / 16) << "32 times finer steps, piecewise smooth";
}

// A step through the plane of a thin rectangle changes its shadow continuously as well.
TEST(VisibilityTest, ContinuousThroughTheOccludersPlane) {
  const std::vector<Surface> surfaces = {occluder(
      RectangleShape{0.8, 0.8}, {1, 0, 0}, Eigen::AngleAxisd(kPi / 2, Vector3d::UnitZ()).matrix())};
  double last = see(surfaces, {2, -1e-3, 0}).fraction;
  for (double y = -1e-3; y <= 1e-3; y += 1e-5) {
    const double now = see(surfaces, {2, y, 0}).fraction;
    // The plate reaches from x = 0.6 to 1.4; its far end's shadow moves 1.4 / 0.6 times as fast.
    EXPECT_NEAR(now, last, 3 * 1e-5);
    last = now;
  }
}

Scene scene_with(const std::vector<Surface>& occluders) {
  Scene scene;
  scene.surfaces = occluders;
  scene.hidden.shape = RectangleShape{0.2, 0.2};
  scene.unknowns = {{Component::x, 0.8, 1.2, std::nullopt}, {Component::y, 0.5, 1.0, std::nullopt}};
  return scene;
}

// The plan may drop faces, but only such as hide nothing from anywhere in the search region.
TEST(TransportPlanTest, DroppedFacesHideNothing) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Vector3d> relay;
  for (const double y : {-1.0, 1.0}) {
    for (const double z : {-0.6, 0.6}) relay.emplace_back(0, y, z);
  }
  int dropped = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const Vector3d center(1.5 * uniform(random), 2 * uniform(random), 1.2 * uniform(random));
    const Surface surface =
        trial % 2 == 0 ? occluder(RectangleShape{0.5, 0.8}, center, random_axes(random))
                       : occluder(BoxShape{{0.4, 0.6, 0.3}}, center,
                                  Eigen::AngleAxisd(uniform(random), Vector3d::UnitZ()).matrix());
    const Scene scene = scene_with({surface});
    const TransportPlan plan = make_plan(scene, relay, 2.0);
    const auto all = occluder_faces(scene.surfaces);
    ASSERT_LE(plan.occluders.size(), all.size());
    if (plan.occluders.size() == all.size()) continue;
    ++dropped;
    for (int i = 0; i < 20; ++i) {
      // A point of the object somewhere in the search region.
      const Vector3d viewpoint(1.0 + 0.2 * uniform(random) + 0.1 * uniform(random),
                               0.75 + 0.25 * uniform(random) + 0.1 * uniform(random),
                               0.1 * uniform(random));
      const Patch patch;
      const auto fraction = [&](const std::vector<OccluderFace>& faces) {
        return ShadowView(faces, viewpoint).see(patch.center, patch.half_u, patch.half_v).fraction;
      };
      EXPECT_NEAR(fraction(plan.occluders), fraction(all), 1e-9) << trial;
    }
  }
  EXPECT_GT(dropped, 50);
}

TEST(TransportPlanTest, EveryDecisionCarriesItsReason) {
  Scene scene = scene_with({occluder(RectangleShape{1, 1}, {-5, 0, 0})});
  const std::vector<Vector3d> relay = {{0, -1, 0}, {0, 1, 0}};
  const TransportPlan plan = make_plan(scene, relay, 2.0);
  EXPECT_TRUE(plan.occluders.empty());
  EXPECT_EQ(plan.kernel, Kernel::lambertian);
  for (const PlanDecision& decision : plan.decisions) EXPECT_FALSE(decision.reason.empty());
  // A lobe of a degree at about 1.5 m is small against a spot of 2 m, one of 20 degrees is not.
  scene.hidden.material = RetroreflectiveMaterial{1 * kDegree};
  EXPECT_EQ(make_plan(scene, relay, 2.0).kernel, Kernel::retro_single);
  scene.hidden.material = RetroreflectiveMaterial{20 * kDegree};
  EXPECT_EQ(make_plan(scene, relay, 2.0).kernel, Kernel::retro_pairs);
}

// What is said of many patches at once must agree with the clipping of each.
TEST(VisibilityTest, SightsOfManyPatchesAreThoseOfEach) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> at(-1, 1);
  constexpr int kPatches = 40;
  constexpr auto kRoom = static_cast<std::size_t>(3 * ShadowView::kChunk);
  std::array<std::array<std::vector<double>, 3>, 3> arrays;
  for (auto& vectors : arrays) {
    for (auto& a : vectors) a.assign(kRoom, 0.0);
  }
  int hidden = 0, mixed = 0, clear = 0;
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<Patch> patches;
    for (std::size_t i = 0; i < kPatches; ++i) {
      const Patch patch{{0, at(random), at(random)},
                        {0, 0.1 * at(random), 0.1 * at(random)},
                        {0, 0.1 * at(random), 0.1 * at(random)}};
      patches.push_back(patch);
      for (Eigen::Index k = 0; k < 3; ++k) {
        const auto c = static_cast<std::size_t>(k);
        arrays[0][c][i] = patch.center[k];
        arrays[1][c][i] = patch.half_u[k];
        arrays[2][c][i] = patch.half_v[k];
      }
    }
    const auto pointers = [&](std::size_t a) {
      return std::array<const double*, 3>{arrays[a][0].data(), arrays[a][1].data(),
                                          arrays[a][2].data()};
    };
    const std::vector<Surface> surfaces = {
        occluder(RectangleShape{1.2, 0.8}, {1, at(random), at(random)}),
        occluder(BoxShape{{0.2, 0.5, 0.5}}, {0.8, at(random), at(random)})};
    const ShadowView view(occluder_faces(surfaces), {2, at(random), at(random)});
    std::array<ShadowView::Sight, kPatches> sights;
    view.sights({pointers(0), pointers(1), pointers(2)}, 0, kPatches, sights.data());
    for (std::size_t i = 0; i < kPatches; ++i) {
      const double fraction =
          view.see(patches[i].center, patches[i].half_u, patches[i].half_v).fraction;
      if (sights[i] == ShadowView::Sight::hidden) {
        EXPECT_LT(fraction, 1e-12);
        ++hidden;
      } else if (sights[i] == ShadowView::Sight::clear) {
        EXPECT_EQ(fraction, 1);
        ++clear;
      } else {
        ++mixed;
      }
    }
  }
  EXPECT_GT(hidden, 100);
  EXPECT_GT(clear, 100);
  EXPECT_GT(mixed, 100);
}

TEST(VisibilityTest, FacesClearOfABallAreForgotten) {
  const std::vector<Surface> surfaces = {occluder(RectangleShape{0.5, 0.5}, {1, 0, 0})};
  ShadowView view(occluder_faces(surfaces), {2, 0, 0});
  view.leave_out_clear_of({0, 0.9, 0}, 0.5);  // the shadow reaches to y = 0.5
  EXPECT_FALSE(view.empty());
  view.leave_out_clear_of({0, 1.1, 0}, 0.5);
  EXPECT_TRUE(view.empty());
}

}  // namespace
}  // namespace blindcorner
