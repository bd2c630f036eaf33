// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/control/speed_profile.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "blindcorner/forward/error.h"
#include "unit/planner/control/test_paths.h"

namespace blindcorner {
namespace {

const VehicleLimits kLimits{.speed = 50, .acceleration = 5, .friction = 8.829};

TEST(SpeedProfile, BrakesInTheDistanceOfClosedForm) {
  const auto path = straight_path(100, 0.5);
  SpeedProfileOptions options{.speed = 12, .start = 12, .end = 0};
  const auto speeds = speed_profile(path, kLimits, options);
  const double braking = options.braking * kLimits.friction;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const double left = 100 - path[i].arc_length;
    EXPECT_NEAR(speeds[i], std::min(12.0, std::sqrt(2 * braking * left)), 1e-9);
  }
}

TEST(SpeedProfile, StartsWithTheGivenAcceleration) {
  const auto path = straight_path(100, 0.5);
  const auto speeds = speed_profile(path, kLimits, {.speed = 10, .start = 0, .end = 10});
  const double driving = 0.3 * kLimits.friction;
  EXPECT_NEAR(speeds[20], std::sqrt(2 * driving * 10), 1e-9);
  EXPECT_DOUBLE_EQ(speeds.back(), 10);
}

TEST(SpeedProfile, SlowsForCurves) {
  const auto path = l_turn(15, 40, 0.25);
  const auto speeds = speed_profile(path, kLimits, {.speed = 20, .start = 20, .end = 20});
  for (std::size_t i = 0; i < path.size(); ++i) {
    EXPECT_LE(speeds[i] * speeds[i] * path[i].curvature, 0.9 * kLimits.friction * (1 + 1e-12));
  }
  EXPECT_NEAR(*std::ranges::min_element(speeds), std::sqrt(0.9 * kLimits.friction * 15), 1e-9);
}

TEST(SpeedProfile, StaysInTheFrictionCircle) {
  const auto path = l_turn(15, 40, 0.25);
  const SpeedProfileOptions options{.speed = 20, .start = 0, .end = 0};
  const auto speeds = speed_profile(path, kLimits, options);
  for (std::size_t i = 0; i + 1 < path.size(); ++i) {
    const double along = (speeds[i + 1] * speeds[i + 1] - speeds[i] * speeds[i]) /
                         (2 * (path[i + 1].arc_length - path[i].arc_length));
    for (const std::size_t end : {i, i + 1}) {
      const double across = speeds[end] * speeds[end] * path[end].curvature;
      EXPECT_LE(std::hypot(along, across), kLimits.friction * (1 + 1e-9));
    }
  }
}

TEST(SpeedProfile, PassesACuspSlowlyButDoesNotStand) {
  auto path = straight_path(20, 0.5);
  path[20].curvature = std::numeric_limits<double>::infinity();
  const auto speeds = speed_profile(path, kLimits, {.speed = 10, .start = 10, .end = 10});
  // A turn back within the 1 m between the neighbours: 2 pi per metre.
  EXPECT_NEAR(speeds[20], std::sqrt(0.9 * kLimits.friction / (2 * std::numbers::pi)), 1e-9);
  for (const double speed : speeds) EXPECT_GT(speed, 0.5);
  EXPECT_GT(speeds[24], speeds[20]);
}

TEST(SpeedProfile, LeavesCurvesAloneWhenTold) {
  SpeedProfileOptions options{.speed = 12, .start = 12, .end = 12};
  options.cornering = std::numeric_limits<double>::infinity();
  for (const double speed : speed_profile(l_turn(15, 40, 0.25), kLimits, options)) {
    EXPECT_DOUBLE_EQ(speed, 12);
  }
}

TEST(SpeedProfile, RefusesNonsense) {
  EXPECT_THROW(speed_profile(straight_path(1, 0.5), kLimits, {.speed = -1}), Error);
  EXPECT_THROW(speed_profile(straight_path(1, 0.5), kLimits, {.braking = 2}), Error);
  EXPECT_TRUE(speed_profile({}, kLimits).empty());
}

}  // namespace
}  // namespace blindcorner
