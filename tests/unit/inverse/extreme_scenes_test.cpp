// SPDX-License-Identifier: Apache-2.0
/// Scenes at the ends of what the solver is asked: objects at the wall, sizes that trade with
/// brightness, search regions far larger than the light reaches. Captures are the reference
/// renderer's.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numeric>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/forward/transport/transport_plan.h"
#include "blindcorner/inverse/fit.h"
#include "blindcorner/simulation/simulated_sensor.h"
#include "blindcorner/simulation/synthetic.h"
#include "bundled.h"

namespace blindcorner {
namespace {

Unknown unknown(Component component, double lower, double upper) {
  Unknown u;
  u.component = component;
  u.lower = lower;
  u.upper = upper;
  return u;
}

/// What became of captures of truths within `low` to `high`.
struct Outcome {
  int detected = 0;
  int in_region = 0;  ///< truths in a mode's region, of those detected
};

struct Study {
  Scene scene;
  PoseVector low, high;
  int captures = 12;
  double photons = 1000;
  double region = 0;  ///< quantile of chi squared
  double amplitude_spread = 0;
};

Outcome run(const Study& study) {
  const Fitter fitter(study.scene, FitOptions{});
  const auto renderer = make_reference_renderer(study.scene, sensor_placement(study.scene));
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform;
  std::normal_distribution<double> normal;
  Outcome outcome;
  for (int i = 0; i < study.captures; ++i) {
    PoseVector truth = study.low;
    for (Eigen::Index k = 0; k < truth.size(); ++k) {
      truth[k] += (study.high[k] - study.low[k]) * uniform(random);
    }
    LightBudget budget;
    budget.third_bounce_photons = study.photons;
    budget.amplitude = std::exp(study.amplitude_spread * normal(random));
    const auto seed = static_cast<std::uint64_t>(100 + i);
    const FitResult result = fitter.fit(make_capture(study.scene, *renderer, truth, budget, seed));
    if (std::ranges::find(result.flags, "nothing_detected") != result.flags.end()) continue;
    ++outcome.detected;
    const bool in = std::ranges::any_of(result.posterior.modes, [&](const PoseMode& mode) {
      const PoseVector d = pose_error(study.scene, mode.pose, truth);
      return d.dot(mode.covariance.ldlt().solve(d)) <= study.region;
    });
    outcome.in_region += in ? 1 : 0;
  }
  return outcome;
}

constexpr double k95Of2 = 5.991, k95Of3 = 7.815;
constexpr double k999Of3 = 16.27, k999Of4 = 18.47, k999Of6 = 22.46;

TEST(ExtremeScenes, ABoxThatTouchesTheWallIsWhereTheFitSays) {
  Study study;
  study.scene = bundled_scene("tmf8828_wall");
  study.scene.hidden.shape = BoxShape{Eigen::Vector3d::Constant(0.2)};
  study.scene.hidden.placement.position = {0.48, 0.5, 1.0};
  study.scene.hidden.placement.yaw = 0;
  study.scene.unknowns = {unknown(Component::x, 0.15, 0.499), unknown(Component::y, 0.35, 0.7)};
  study.low = Eigen::Vector2d(0.45, 0.4);  // 0 to 5 cm between box and wall
  study.high = Eigen::Vector2d(0.4999, 0.65);
  study.photons = 5000;
  study.region = k95Of2;
  const Outcome outcome = run(study);
  EXPECT_EQ(outcome.detected, study.captures);
  EXPECT_GE(outcome.in_region, 10);
}

TEST(ExtremeScenes, SizeAndBrightnessMayBothBeFree) {
  Study study;
  study.scene = bundled_scene("tmf8828_wall");
  study.scene.unknowns = {unknown(Component::x, 0.15, 0.38), unknown(Component::y, 0.35, 0.7),
                          unknown(Component::size, 0.5, 2)};
  study.low = Eigen::Vector3d(0.15, 0.35, 0.5);
  study.high = Eigen::Vector3d(0.38, 0.7, 2);
  study.photons = 5000;
  study.region = k999Of3;
  study.amplitude_spread = 1;
  const Outcome outcome = run(study);
  EXPECT_EQ(outcome.detected, study.captures);
  EXPECT_GE(outcome.in_region, 9);
}

/// The reference renderer's light at one pose, worked out once.
class RememberedLight final : public ForwardModel {
 public:
  RememberedLight(const Scene& scene, const PoseVector& pose)
      : renderer_(make_reference_renderer(scene, sensor_placement(scene))),
        three_bounce_(renderer_->three_bounce(pose)),
        static_return_(renderer_->shadowed_background(pose)) {}

  void three_bounce(const PoseVector& /*pose*/, HistogramCube& out) const override {
    out = three_bounce_;
  }
  const HistogramCube& static_background() const override { return renderer_->static_background(); }
  using ForwardModel::shadowed_background;
  HistogramCube shadowed_background(const PoseVector& /*pose*/, bool /*coarsely*/) const override {
    return static_return_;
  }
  const TransportPlan& plan() const override { return renderer_->plan(); }

 private:
  std::unique_ptr<ForwardModel> renderer_;
  HistogramCube three_bounce_, static_return_;
};

/// Of captures of a pose, one a seed, those whose first `modes` modes hold it.
int found(const std::string& name, const PoseVector& truth, double photons, double region,
          const std::vector<std::uint64_t>& seeds, std::size_t modes = 1) {
  const Scene scene = bundled_scene(name);
  const RememberedLight light(scene, truth);
  const Fitter fitter(scene, FitOptions{});
  LightBudget budget;
  budget.third_bounce_photons = photons;
  int found = 0;
  for (const std::uint64_t seed : seeds) {
    const FitResult result = fitter.fit(make_capture(scene, light, truth, budget, seed));
    const auto& all = result.posterior.modes;
    const bool in = std::ranges::any_of(std::span(all).first(std::min(modes, all.size())),
                                        [&](const PoseMode& mode) {
                                          const PoseVector d = pose_error(scene, mode.pose, truth);
                                          return d.dot(mode.covariance.ldlt().solve(d)) <= region;
                                        });
    found += in ? 1 : 0;
  }
  return found;
}

// At 100,000 photons closed-form light is more than a thousand log units off: it can neither tell
// basins apart nor lead down to an optimum. With these seeds both were left to it once, and the box
// ended turned by 0.7 rad, 100 log units too low.
TEST(BrightScenes, AreFittedWhereTheModelLeads) {
  EXPECT_EQ(found("reference_street_box", Eigen::Vector3d(3.878, 9.050, 1.156), 100'000, k999Of3,
                  {100, 107, 109}),
            3);
}

// Between 10,000 and 30,000 photons closed form is tens of log units off, and one box in ten ended
// at another yaw, sure of it. Of seeds 1 to 25 those that did at either level.
TEST(BrightScenes, OtherYawsAreLookedAt) {
  const auto in_region = [](double photons, const std::vector<std::uint64_t>& seeds) {
    return found("reference_street_box", Eigen::Vector3d(3.878, 9.050, 1.156), photons, k999Of3,
                 seeds, /*modes=*/3);
  };
  EXPECT_GE(in_region(10'000, {8, 23, 24}) + in_region(30'000, {3, 5, 25}), 5);
}

// Where too few places of the sphere behind were followed, it ended 0.2 m off and 10 log units too
// low, sure of it, in 4 of 20 captures of this pose in tracer light and 1 of 12 in the renderer's
// (other seeds): at the border of its region, or on the way along the valley that leads there.
TEST(BrightScenes, OfTwoObjectsEachIsInItsPlace) {
  PoseVector truth(6);
  truth << 0.007, 0.824, 0.900, -0.143, 1.044, 0.950;
  EXPECT_EQ(found("reference_tilted_spheres", truth, 100'000, k999Of6,
                  {100, 101, 102, 103, 104, 105, 106, 107, 108, 109, 110, 111}),
            12);
}

// Where closed form is too rough to choose starts, the model must judge arrangements of both
// objects: it was shown scored poses of all six unknowns, which lie far from anything, and descents
// ended with the spheres on the same side, 26 log units too low and 27 cm off.
TEST(BrightScenes, ArrangementsOfTwoObjectsAreJudgedByTheModel) {
  PoseVector truth(6);
  truth << 0.076, 0.893, 1.017, -0.074, 1.113, 1.067;
  EXPECT_EQ(found("reference_tilted_spheres", truth, 100'000, k999Of6, {3, 8}), 2);
}

// Yaw and place of a plate over an oblique floor trade along a ridge 1 mm wide that bends. With
// these seeds samples once saw one end of it, or the model's last level was a millimetre off.
TEST(BrightScenes, RidgesAreSampledToTheirEnds) {
  const auto in_region = [](const Eigen::Vector3d& truth, double photons,
                            const std::vector<std::uint64_t>& seeds) {
    return found("reference_floor_corner_black", truth, photons, k95Of3, seeds, /*modes=*/3);
  };
  EXPECT_GE(in_region({0.384, 0.872, -1.721}, 100'000, {3, 5}) +
                in_region({0.455, 0.815, -1.936}, 10'000, {1, 6, 9}),
            4);  // of 5
}

// Yaw and place of a plate before a wall trade along a ridge: samples were taken for settled while
// each stage of them still went a little farther, and of this capture the truth lay beyond.
TEST(BrightScenes, RidgesAreSampledUntilTheyGrowNoMore) {
  const Eigen::Vector4d plate(0.25266942, 0.37968171, 0.99290878, -0.72822768);
  EXPECT_EQ(found("tmf8828_wall", plate, 20'000, k999Of4, {31'000'098}), 1);
}

// A box of 2 m at 9 m turns its sides to the facade: posteriors run along ridges and around
// corners, where closed-form light is off by log units and samples must not be weighed with it.
TEST(DimScenes, TheTruthIsInTheRegion) {
  std::vector<std::uint64_t> seeds(12);
  std::iota(seeds.begin(), seeds.end(), 1);
  int in_region = 0;
  for (const auto& [x, y, yaw] : {std::array{3.878, 9.050, 1.156}, std::array{2.39, 9.12, 2.19}}) {
    in_region += found("reference_street_box", Eigen::Vector3d(x, y, yaw), 1000, k95Of3, seeds,
                       /*modes=*/3);
  }
  EXPECT_GE(in_region, 18);  // of 24; 15 where closed form decides
}

// A sensor close to the turn of the street: one render of the finer model of lobes would take a
// second or more, and a fit took a minute. What that model may change widens the claim instead.
TEST(DearModels, AreLeftOutAndTheClaimIsWider) {
  const Scene scene = bundled_scene("street_turn");
  Transform T_world_sensor = Transform::Identity();
  T_world_sensor.translation() << 11.848, 4.143, 1.2;
  T_world_sensor.linear() =
      Eigen::AngleAxisd(31.67 * kDegree, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Vector3d truth(18.437, 18.364, 1.4175);
  const Capture capture = SimulatedSensor(scene).sense(T_world_sensor, truth, 1).capture;
  const FitResult result = Fitter(scene, FitOptions{}).fit(capture);
  EXPECT_TRUE(std::ranges::any_of(result.hints, [](const std::string& hint) {
    return hint.find("finer model") != std::string::npos;
  }));
  const PoseMode& mode = result.posterior.modes.front();
  const PoseVector error = pose_error(scene, mode.pose, truth);
  EXPECT_LT(error.head(2).norm(), 0.1);
  EXPECT_LT(error.dot(mode.covariance.ldlt().solve(error)), k95Of3);
  // Ten per cent of the light, of some hundred standard deviations of it, in any direction.
  EXPECT_GT(std::sqrt(mode.covariance(1, 1)), 0.05);
  EXPECT_LT(std::sqrt(mode.covariance(1, 1)), 0.5);
}

class LargeRegion : public testing::TestWithParam<double> {};

TEST_P(LargeRegion, ShowsTheObjectNearTheWall) {
  const double range = GetParam();
  Study study;
  study.scene = bundled_scene("tmf8828_wall");
  study.scene.unknowns = {unknown(Component::x, 0.55 - range, 0.55),
                          unknown(Component::y, 0.35, 0.35 + range),
                          unknown(Component::yaw, -1.3, 0.5)};
  study.low = Eigen::Vector3d(0.1, 0.35, -1.3);
  study.high = Eigen::Vector3d(0.4, 0.8, 0.5);
  study.region = k999Of3;
  const Outcome outcome = run(study);
  EXPECT_GE(outcome.detected, 9);
  EXPECT_GE(outcome.in_region, outcome.detected - 3);
}

// Where many captures share a placement, tables of exact histograms take the closed form's place,
// unless the region is too large for them, as here.
TEST(LargeRegionOfManyCaptures, IsFitted) {
  Scene scene = bundled_scene("tmf8828_wall");
  scene.unknowns = {unknown(Component::x, -9.45, 0.55), unknown(Component::y, 0.35, 10.35)};
  FitOptions options;
  options.captures_per_placement = 50;
  options.max_scored_poses = 400;
  const auto renderer = make_reference_renderer(scene, sensor_placement(scene));
  LightBudget budget;
  budget.third_bounce_photons = 1000;
  const Capture capture = make_capture(scene, *renderer, Eigen::Vector2d(0.28, 0.5), budget, 1);
  EXPECT_FALSE(fit(scene, capture, options).posterior.modes.empty());
}

INSTANTIATE_TEST_SUITE_P(Metres, LargeRegion, testing::Values(10.0, 1000.0));

TEST(RangesNearRelay, AreNoneWhereTheRegionIsNear) {
  EXPECT_FALSE(ranges_near_relay(bundled_scene("tmf8828_wall")));
}

TEST(RangesNearRelay, AreThoseOfPositionsOnly) {
  Scene scene = bundled_scene("tmf8828_wall");
  scene.unknowns = {unknown(Component::x, -9, 0.5), unknown(Component::y, 0.3, 10),
                    unknown(Component::yaw, -1, 1)};
  const auto near = ranges_near_relay(scene);
  ASSERT_TRUE(near);
  // The region's nearest point to the wall's middle (0.6, 0, 1) is (0.5, 0.3, 1.05).
  const double reach = 2 * std::hypot(0.1, 0.3, 0.05);
  EXPECT_NEAR((*near)[0].lower, 0.5 - reach, 1e-9);
  EXPECT_NEAR((*near)[0].upper, 0.5, 1e-9);
  EXPECT_NEAR((*near)[1].lower, 0.3, 1e-9);
  EXPECT_NEAR((*near)[1].upper, 0.3 + reach, 1e-9);
  EXPECT_EQ((*near)[2].lower, -1);
  EXPECT_EQ((*near)[2].upper, 1);
}

}  // namespace
}  // namespace blindcorner
