// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/credible_level.h"

#include <gtest/gtest.h>

#include <cmath>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

/// x and yaw of a square plate, which looks the same only after a full turn.
Scene plate() {
  Scene scene = testing_scenes::one_narrow_zone();
  scene.hidden.shape = RectangleShape{0.2, 0.2};
  scene.unknowns = {{Component::x, -1, 1, {}}, {Component::yaw, -kPi, kPi, {}}};
  return scene;
}

PoseMode mode(double weight, double x, double yaw, double sigma) {
  PoseMode mode;
  mode.weight = weight;
  mode.pose = Eigen::Vector2d(x, yaw);
  mode.covariance = sigma * sigma * Eigen::Matrix2d::Identity();
  return mode;
}

// Two unknowns: the probability within a distance of d standard deviations is 1 - exp(-d^2 / 2).
TEST(CredibleLevel, OfOneModeIsTheChiSquareProbability) {
  PoseMixture mixture;
  mixture.modes = {mode(1, 0.1, 0.2, 0.01)};
  const int samples = 20'000;
  for (const double d : {0.0, 0.5, 1.0, 2.0, 3.0}) {
    const double expected = 1 - std::exp(-0.5 * d * d);
    const double sigma = std::sqrt(expected * (1 - expected) / samples);
    EXPECT_NEAR(credible_level(plate(), mixture, Eigen::Vector2d(0.1 + 0.01 * d, 0.2), samples),
                expected, 4 * sigma + 1e-9);
  }
}

// The sharp mode's core is denser than all of the wide one, so the wide one's centre lies outside
// of the sharp one's share.
TEST(CredibleLevel, OfTwoModesOrdersByDensity) {
  PoseMixture mixture;
  mixture.modes = {mode(0.6, -0.5, 0, 0.01), mode(0.4, 0.5, 0, 0.1)};
  EXPECT_NEAR(credible_level(plate(), mixture, Eigen::Vector2d(-0.5, 0)), 0, 1e-9);
  // Denser than the wide mode's peak (0.4 / 0.01): the sharp one where exp(-d^2 / 2) > 1 / 150.
  EXPECT_NEAR(credible_level(plate(), mixture, Eigen::Vector2d(0.5, 0), 20'000),
              0.6 * (1 - 1.0 / 150), 0.02);
  EXPECT_NEAR(credible_level(plate(), mixture, Eigen::Vector2d(0, 0.9)), 1, 1e-9);
}

TEST(CredibleLevel, TakesYawTheShortWayAround) {
  PoseMixture mixture;
  mixture.modes = {mode(1, 0, kPi - 0.01, 0.02)};
  EXPECT_LT(credible_level(plate(), mixture, Eigen::Vector2d(0, -kPi + 0.01)), 0.7);
}

// Wilson 1927 for 0 and 5 of 10, from the closed form with z = 1.96.
TEST(WilsonInterval, OfFewTrials) {
  EXPECT_NEAR(wilson_interval(5, 10).low, 0.2366, 1e-4);
  EXPECT_NEAR(wilson_interval(5, 10).high, 0.7634, 1e-4);
  EXPECT_NEAR(wilson_interval(0, 10).low, 0, 1e-12);
  EXPECT_NEAR(wilson_interval(0, 10).high, 0.2775, 1e-4);
  EXPECT_EQ(wilson_interval(0, 0).high, 1);
}

TEST(MeanInterval, IsStudents) {
  // 1, 2, 3, 4, 5: mean 3, standard error sqrt(2.5 / 5), t of four degrees of freedom 2.7764.
  const std::vector<double> values{1, 2, 3, 4, 5};
  const MeanInterval interval = mean_interval(values);
  EXPECT_DOUBLE_EQ(interval.mean, 3);
  EXPECT_NEAR(interval.high - 3, 2.7764 * std::sqrt(0.5), 0.01);
  EXPECT_NEAR(mean_interval(std::vector<double>{0, 2}).high, 1 + 12.706, 1e-3);
  EXPECT_THROW(mean_interval(std::vector<double>{1}), Error);
}

}  // namespace
}  // namespace blindcorner
