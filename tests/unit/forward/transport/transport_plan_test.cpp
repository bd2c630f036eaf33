// SPDX-License-Identifier: Apache-2.0
/// What a scene does not need is left out, and switching it on changes nothing beyond its bound.
#include "blindcorner/forward/transport/transport_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "bundled.h"
#include "forward/relay/ray_scene.h"
#include "forward/relay/relay_setup.h"
#include "forward/relay/visibility.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;
using testing_scenes::at_tolerance;
using testing_scenes::random_pose;

double peak(const HistogramCube& cube) {
  return *std::max_element(cube.values.begin(), cube.values.end());
}

/// Largest change of a bin as a share of the peak.
double change(const HistogramCube& a, const HistogramCube& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    largest = std::max(largest, std::abs(a.values[i] - b.values[i]));
  }
  return largest / peak(a);
}

class ShippedScene : public testing::TestWithParam<const char*> {
 protected:
  Scene scene() const { return bundled_scene(GetParam()); }
};

// The coarse tolerance keeps the test short; the bounds have to hold at any.
TEST_P(ShippedScene, SwitchingOnWhatIsLeftOutStaysWithinTheBound) {
  const Scene s = scene();
  const SensorPlacement sensor = sensor_placement(s);
  FastModelOptions options;
  options.tolerance = 0.1;
  options.sampling_step = make_fast_model(s, sensor, options)->sampling_step();
  const auto plain = make_fast_model(s, sensor, options);
  std::mt19937_64 random(5);
  std::vector<PoseVector> poses;
  std::vector<HistogramCube> light;
  double brightest = 0;
  while (poses.size() < 4) {
    poses.push_back(random_pose(s, random));
    light.push_back(plain->three_bounce(poses.back()));
    brightest = std::max(brightest, peak(light.back()));
  }
  int switched = 0;
  // Patches that straddle a curved cell's horizon are clipped there, or judged by their middle.
  const double horizon = 1e-4;
  for (const PlanDecision& decision : plain->plan().decisions) {
    EXPECT_FALSE(decision.reason.empty()) << decision.name;
    const bool lobe = decision.term == Term::patch_pairs &&
                      plain->plan().kernel == Kernel::retro_single;  // tested below
    if (decision.used || decision.term == Term::object_in_view ||
        decision.term == Term::direct_return || lobe) {
      continue;
    }
    ASSERT_TRUE(std::isfinite(decision.bound)) << decision.name;
    FastModelOptions with = options;
    with.overrides.on = {decision.term};
    const auto model = make_fast_model(s, sensor, with);
    for (std::size_t i = 0; i < poses.size(); ++i) {
      if (peak(light[i]) < 1e-3 * brightest) continue;
      const double moved = change(light[i], model->three_bounce(poses[i]));
      const double slack = decision.term == Term::self_shadowing ? horizon : 1e-9;
      EXPECT_LE(moved, decision.bound + slack) << decision.name << ", pose " << i;
    }
    ++switched;
  }
  EXPECT_GE(switched, 2);
}

// Where the plan says that the object never stands before the sensor, no ray of light or sight
// meets it.
TEST_P(ShippedScene, ObjectOutOfViewIsMetByNoRay) {
  const Scene s = scene();
  const SensorPlacement sensor = sensor_placement(s);
  const auto model = make_fast_model(s, sensor, at_tolerance(0.3));
  if (model->plan().decision(Term::object_in_view).bound > 0) GTEST_SKIP() << "not claimed";
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform;
  const RelaySetup setup(s, sensor);
  const auto& field = std::get<AngularRectangle>(s.sensor.field);
  for (int i = 0; i < 60; ++i) {
    const Placement placement = place(s.hidden.placement, s.unknowns, random_pose(s, random));
    Surface body;
    body.shape = s.hidden.shape;
    body.T_world_surface = object_to_world(s.hidden.shape, s.hidden.anchor, placement);
    const RayScene rays({body});
    const RayScene known(s.surfaces);
    for (int ray = 0; ray < 40; ++ray) {
      const double right = std::tan(field.left + uniform(random) * (field.right - field.left));
      const double down = std::tan(field.top + uniform(random) * (field.bottom - field.top));
      const Vector3d direction =
          sensor.T_world_sensor.linear() * direction_from_tangents(right, down);
      const auto wall = known.first_hit(setup.source(), direction);
      const auto object = rays.first_hit(setup.source(), direction);
      if (wall && object) {
        EXPECT_GT(object->distance, wall->distance);
      }
    }
  }
}

class SingleSum : public testing::TestWithParam<const char*> {
 protected:
  Scene scene_ = bundled_scene(GetParam());
  SensorPlacement sensor_ = sensor_placement(scene_);
  PoseVector pose_ = pose_of(scene_.hidden.placement, scene_.unknowns);
};

// The relay is divided by the lobe whatever the sampling_step, which spares a fine one.
TEST_P(SingleSum, StaysWithinItsBoundOfPairs) {
  const auto single = make_fast_model(scene_, sensor_, at_tolerance(0.3));
  ASSERT_EQ(single->plan().kernel, Kernel::retro_single);
  FastModelOptions options = at_tolerance(0.3);
  options.sampling_step = single->sampling_step();
  options.overrides.on = {Term::patch_pairs};
  const auto pairs = make_fast_model(scene_, sensor_, options);
  ASSERT_EQ(pairs->plan().kernel, Kernel::retro_pairs);
  EXPECT_LE(change(single->three_bounce(pose_), pairs->three_bounce(pose_)),
            single->plan().decision(Term::patch_pairs).bound);
}

// Sampled at 0.45 of its default the reference is right to 2 % of the peak.
TEST_P(SingleSum, StaysWithinItsBoundOfTheReference) {
  FastModelOptions options = at_tolerance(0.02);
  options.overrides.off = {Term::patch_pairs};
  const auto single = make_fast_model(scene_, sensor_, options);
  ASSERT_EQ(single->plan().kernel, Kernel::retro_single);
  const auto reference = make_reference_renderer(scene_, sensor_, reference_sampling(0.45));
  EXPECT_LE(change(reference->three_bounce(pose_), single->three_bounce(pose_)),
            single->plan().decision(Term::patch_pairs).bound);
}

INSTANTIATE_TEST_SUITE_P(TransportPlan, SingleSum,
                         testing::Values("denali_like", "robot_corridor", "tmf8828_floor"),
                         [](const auto& tested) { return std::string(tested.param); });

INSTANTIATE_TEST_SUITE_P(TransportPlan, ShippedScene,
                         testing::Values("tmf8828_wall", "tmf8828_floor", "robot_corridor",
                                         "denali_like", "person_vl53l8ch", "street_corner",
                                         "ams_u"),
                         [](const auto& tested) { return std::string(tested.param); });

// The plan is made for the search region; a pose elsewhere gets all occluders back.
TEST(TransportPlan, PosesOutsideOfTheSearchRegionKeepAllOccluders) {
  Scene s = bundled_scene("tmf8828_wall");
  s.sensor.bins = 256;  // the pose is farther than the scene's own axis reaches
  Surface plate;
  plate.name = "plate";
  plate.shape = BoxShape{{0.3, 0.02, 0.3}};
  plate.T_world_surface.translation() = Vector3d(0.4, 1.0, 1);
  plate.occluder = true;
  s.surfaces.push_back(plate);
  FastModelOptions options;
  options.tolerance = 0.1;
  options.sampling_step = SamplingStep{2, 2};
  const auto planned = make_fast_model(s, sensor_placement(s), options);
  options.overrides.on = {Term::occlusion};
  const auto all = make_fast_model(s, sensor_placement(s), options);
  ASSERT_LT(planned->plan().occluders.size(), all->plan().occluders.size());
  PoseVector outside = pose_of(s.hidden.placement, s.unknowns);
  outside << 0.1, 1.4, 1.0, -65 * kDegree;
  EXPECT_FALSE(in_search_region(s, place(s.hidden.placement, s.unknowns, outside)));
  const HistogramCube want = all->three_bounce(outside);
  ASSERT_GT(peak(want), 0.0);
  EXPECT_EQ(planned->three_bounce(outside).values, want.values);
  s.surfaces.pop_back();
  const auto without = make_fast_model(s, sensor_placement(s), options);
  EXPECT_GT(change(want, without->three_bounce(outside)), 0.01) << "the plate does stand there";
}

// Decisions follow the scene: what could matter is used.
TEST(TransportPlan, DecisionsFollowTheScene) {
  Scene s = bundled_scene("tmf8828_wall");
  const auto plan = [&] {
    return make_fast_model(s, sensor_placement(s), at_tolerance(0.3))->plan();
  };
  EXPECT_TRUE(plan().decision(Term::occlusion).used);
  EXPECT_TRUE(plan().decision(Term::direct_return).used);
  EXPECT_EQ(plan().decision(Term::object_in_view).bound, 0.0);
  s.linear.direct = LinearMode::fixed;
  s.linear.fixed_direct = 0;
  EXPECT_FALSE(plan().decision(Term::direct_return).used);
  s.surfaces.pop_back();
  EXPECT_FALSE(plan().decision(Term::occlusion).used);
  for (Unknown& unknown : s.unknowns) {  // right before the sensor
    if (unknown.component == Component::y) unknown.lower = -0.1;
  }
  EXPECT_FALSE(std::isfinite(plan().decision(Term::object_in_view).bound));
}

// A body's own faces hide nothing from its own surface, whatever its shape and pose.
TEST(TransportPlan, ConvexBodiesDoNotShadowThemselves) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const Shape& shape : {Shape(RectangleShape{0.3, 0.5}), Shape(BoxShape{{0.2, 0.5, 0.9}}),
                             Shape(SphereShape{0.3}), Shape(CylinderShape{0.2, 0.8})}) {
    for (int i = 0; i < 20; ++i) {
      Placement placement;
      placement.position = Vector3d(uniform(random), uniform(random), uniform(random));
      placement.yaw = kPi * uniform(random);
      const Transform T = object_to_world(shape, Anchor::center, placement);
      const auto faces = body_faces(shape, T, 1.0);
      for (const SurfaceCell& cell : divide(shape, T, 1.0, 0.2, 2)) {
        const ShadowView view(faces, cell.center);
        const Vector3d side = cell.normal.unitOrthogonal();
        // A patch that lies on the cell's front side as a whole.
        const VisiblePart part = view.see(cell.center + 0.6 * cell.normal + 0.5 * side, 0.2 * side,
                                          0.2 * cell.normal.cross(side));
        EXPECT_NEAR(part.fraction, 1.0, 1e-9) << shape_name(shape);
      }
    }
  }
}

}  // namespace
}  // namespace blindcorner
