// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/bound/error_bound.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/fit.h"
#include "bundled.h"
#include "unit/error_message.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using ::testing::HasSubstr;

BoundOptions small() {
  BoundOptions options;
  options.test_poses = 60;
  options.empty_captures = 16;
  options.ambient = 1;
  return options;
}

PoseBound bound_at_middle(const Scene& scene, const BoundOptions& options) {
  const ErrorBound bound(scene, sensor_placement(scene), options);
  return bound.at(testing_scenes::stated_pose(scene));
}

// As the root of the light, less what the error of the static background and the prior of the
// brightness leave: of more light both leave less than half.
TEST(ErrorBound, FallsWithTheRootOfLight) {
  const Scene scene = bundled_scene("tmf8828_wall");
  BoundOptions options = small();
  options.ambient = 40;
  options.exposures = 0.015;  // some hundred photons
  const PoseBound dim = bound_at_middle(scene, options);
  options.exposures = 0.06;
  const PoseBound bright = bound_at_middle(scene, options);
  const double ratio =
      std::sqrt(position_trace(scene, dim.cramer_rao) / position_trace(scene, bright.cramer_rao));
  EXPECT_GT(ratio, 1.7);
  EXPECT_LT(ratio, 2.05);
  EXPECT_NEAR(bright.photons / dim.photons, 4, 1e-9);
  EXPECT_GT(bright.detection_probability, dim.detection_probability);
}

TEST(ErrorBound, IsThePriorWithoutLight) {
  const Scene scene = bundled_scene("tmf8828_wall");
  BoundOptions options = small();
  options.exposures = 1e-6;
  options.ambient = 1e4;
  const ErrorBound bound(scene, sensor_placement(scene), options);
  const PoseBound dark = bound.at(testing_scenes::stated_pose(scene));
  const double prior = position_trace(scene, bound.prior());
  EXPECT_NEAR(position_trace(scene, dark.with_prior) / prior, 1, 1e-3);
  // Poses that nothing tells apart: the covariance of the test poses, which fill the region.
  EXPECT_NEAR(position_trace(scene, dark.ambiguity) / prior, 1, 0.15);
  EXPECT_NEAR(dark.detection_probability, 0.05, 0.02) << "false alarms only";
  EXPECT_GT(position_trace(scene, dark.cramer_rao), 100 * prior);
}

// Behind the wall no light goes: whatever is noticed there is a false alarm.
TEST(ErrorBound, NoticesNothingWhereNoLightGoes) {
  Scene scene = bundled_scene("tmf8828_wall");
  scene.unknowns.front().lower = 0.8;
  scene.unknowns.front().upper = 1.2;
  PoseVector pose = testing_scenes::stated_pose(scene);
  pose[0] = 1;
  const PoseBound behind = ErrorBound(scene, sensor_placement(scene), small()).at(pose);
  EXPECT_NEAR(behind.photons, 0, 1e-6);
  EXPECT_LT(behind.detection_probability, 0.06);
}

// Without any other light the first photon is noticed, and one of a hundred captures holds one.
TEST(ErrorBound, NoticesNoMoreThanThereArePhotons) {
  Scene scene = bundled_scene("tmf8828_wall");
  scene.linear.direct = LinearMode::fixed;
  scene.linear.fixed_direct = 0;
  BoundOptions options = small();
  options.ambient = 0;
  options.exposures *= 0.01 / bound_at_middle(scene, options).photons;
  const PoseBound dark = bound_at_middle(scene, options);
  EXPECT_NEAR(dark.photons, 0.01, 1e-6);
  EXPECT_LE(dark.detection_probability, 0.05 + 0.01);
}

// Errors of fits: no smaller than the bound, and not much larger where there is light.
TEST(ErrorBound, HoldsForFits) {
  const Scene scene = bundled_scene("tmf8828_wall");
  const PoseVector truth = testing_scenes::stated_pose(scene);
  const double photons = 20000;
  FitOptions fast;
  fast.empty_captures = 0;
  const Fitter fitter(scene, fast);
  std::mt19937_64 random(5);
  double squares = 0;
  constexpr int kCaptures = 16;
  double exposures = 0;
  for (int i = 0; i < kCaptures; ++i) {
    const Capture capture = testing_scenes::reference_capture(scene, truth, photons, random());
    exposures = capture.exposures;
    const FitResult result = fitter.fit(capture);
    const PoseVector error = pose_error(scene, result.posterior.mean, truth);
    for (std::size_t k = 0; k < scene.unknowns.size(); ++k) {
      if (scene.unknowns[k].component > Component::z) continue;
      squares += std::pow(error[static_cast<Eigen::Index>(k)], 2) / kCaptures;
    }
  }
  BoundOptions options = small();
  options.exposures = exposures;
  options.ambient = photons / exposures / (scene.sensor.zone_count() * 20);  // as the capture has
  const PoseBound bound = bound_at_middle(scene, options);
  // In the middle of the prior the posterior's mean is drawn towards the truth: where data and
  // prior tell as much, its variance is half of the bound's. Three standard deviations (18 % each,
  // 16 captures) below the root of that is 0.33.
  EXPECT_GT(std::sqrt(squares), 0.33 * bound.position_error);
  EXPECT_LT(std::sqrt(squares), 2.5 * bound.position_error);
}

TEST(ErrorBound, RefusesWhatMakesNoSense) {
  Scene scene = bundled_scene("tmf8828_wall");
  BoundOptions options = small();
  options.exposures = 0;
  EXPECT_THAT(message_of([&] { ErrorBound(scene, sensor_placement(scene), options); }),
              HasSubstr("BoundOptions.exposures: accepted: above 0"));
  scene.unknowns.clear();
  EXPECT_THAT(message_of([&] { ErrorBound(scene, sensor_placement(scene), small()); }),
              HasSubstr("unknowns: found none"));
}

}  // namespace
}  // namespace blindcorner
