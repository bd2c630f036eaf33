// SPDX-License-Identifier: Apache-2.0
// Limits on paper against the geometry of the crossing, in closed form.
#include "blindcorner/simulation/drive_limits.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "blindcorner/forward/error.h"
#include "blindcorner/planner/control/path_follower.h"
#include "bundled.h"

namespace blindcorner {
namespace {

constexpr double kCyclist = 5.6;  // m/s, the fastest of 2.8 to 5.6

const Drive& crossing_drive() { return bundled_drive("crossing_cyclist"); }

const SimulatedSensor& crossing_sensor() {
  static const SimulatedSensor made(crossing_drive().scene);
  return made;
}

DriveLimits limits_of(const Drive& drive, int speeds = 4) {
  DriveLimitsOptions options;
  options.speeds = speeds;
  options.light_every = 0;
  return drive_limits(drive, crossing_sensor(), options);
}

/// Both centres would meet at time 0; the bodies touch at the first time at which they overlap
/// along both axes: car 4.5 m x 1.8 m, cyclist 0.6 m x 1.9 m across and along his way.
double contact(double speed) { return -std::min((2.25 + 0.3) / speed, (0.9 + 0.95) / kCyclist); }

TEST(DriveLimits, DirectSightComesPastTheCorner) {
  const DriveLimits limits = limits_of(crossing_drive());
  ASSERT_EQ(limits.speed.size(), 4U);
  EXPECT_DOUBLE_EQ(limits.speed.front(), 5.56);
  EXPECT_DOUBLE_EQ(limits.speed.back(), 16.67);
  for (std::size_t i = 0; i < limits.speed.size(); ++i) {
    // The sensor is v t - 2 m before his line and looks past the corner, whose face is 4 m beside
    // the lane's middle and 1.25 m before his line. His front's far corner, 0.3 m behind it,
    // comes into sight first.
    const double v = limits.speed[i];
    double t = 3.5;
    const auto hidden = [&] {
      const double off = v * t - 2;
      return kCyclist * t - 0.95 > 4 * (off + 0.3) / (off - 1.25);
    };
    while (hidden()) t -= 1e-4;
    ASSERT_TRUE(limits.sight[i].has_value());
    // Rays are as close as a cell, 0.25 m, is wide at 60 m: 6 cm at a distance of 15 m.
    EXPECT_NEAR(*limits.sight[i], t + contact(v), 0.03) << v;
  }
}

TEST(DriveLimits, AStandingObjectNeedsTheDistanceToStop) {
  Drive drive = crossing_drive();
  drive.truth.meeting.reset();
  drive.truth.velocity = {Eigen::Vector2d::Zero()};
  drive.truth.velocity_upper.clear();
  drive.truth.components = {TrueComponent{0, 0}, TrueComponent{-1.5, -1.5},
                            TrueComponent{1.5708, 1.5708}};
  const double reaction = 0.1 + PathFollowerOptions{}.delay;
  const DriveLimits limits = limits_of(drive);
  for (std::size_t i = 0; i < limits.speed.size(); ++i) {
    // It stops after v / (2 b) of driving on.
    const double needed = limits.speed[i] / (2 * 0.9 * 9.81) + reaction;
    ASSERT_TRUE(limits.stop[i].has_value());
    EXPECT_NEAR(*limits.stop[i], needed, 0.04) << limits.speed[i];  // two control periods
  }
  EXPECT_FALSE(limits.sight_limit) << "it is seen all the way";
}

TEST(DriveLimits, LessFrictionAndLongerDelaysLowerTheLimit) {
  const DriveLimits dry = limits_of(crossing_drive());
  ASSERT_TRUE(dry.sight_limit.has_value());
  EXPECT_GT(*dry.sight_limit, 5.56);
  Drive wet = crossing_drive();
  wet.vehicle.friction = 0.3;
  const DriveLimits slippery = limits_of(wet);
  ASSERT_TRUE(slippery.sight_limit.has_value());
  EXPECT_LT(*slippery.sight_limit, *dry.sight_limit);
  Drive slow = crossing_drive();
  slow.delay["los"] = 0.3;
  EXPECT_LT(limits_of(slow).sight_limit.value_or(99), *dry.sight_limit);
}

// The robot's sensor, whose frames are cheap.
TEST(DriveLimits, MoreLightTellsEarlier) {
  Drive drive = bundled_drive("robot");
  const SimulatedSensor usual(drive.scene), dim(with_light(drive.scene, 0.01));
  DriveLimitsOptions options;
  options.light_every = 1;
  const DriveLimits limits = drive_limits(drive, usual, options);
  const DriveLimits less = drive_limits(drive, dim, options);
  ASSERT_EQ(limits.light.size(), 1U);
  ASSERT_TRUE(limits.light[0] && limits.sight[0]);
  EXPECT_GT(*limits.light[0], *limits.sight[0]) << "the sign is found before it is seen";
  EXPECT_LT(less.light[0].value_or(0), *limits.light[0]);
  drive.delay["solver"] += 0.2;
  EXPECT_NEAR(*drive_limits(drive, usual, options).light[0], *limits.light[0] - 0.2, 1e-9);
}

TEST(DriveLimits, AreWrittenWithNullWhereThereIsNone) {
  DriveLimits limits;
  limits.speed = {5, 6};
  limits.sight = {1.0, std::nullopt};
  limits.stop = limits.light = {2.0, 3.0};
  limits.sight_limit = 5.5;
  const auto json = nlohmann::json::parse(limits_json(limits));
  EXPECT_EQ(json["direct_sight_s"][0], 1.0);
  EXPECT_TRUE(json["direct_sight_s"][1].is_null());
  EXPECT_EQ(json["direct_sight_limit_m_per_s"], 5.5);
  EXPECT_TRUE(json["light_limit_m_per_s"].is_null());
}

TEST(DriveLimits, NeedToKnowWhoIsMet) {
  EXPECT_TRUE(states_who_is_met(crossing_drive()));
  Drive drive = crossing_drive();
  drive.truth.meeting.reset();
  EXPECT_FALSE(states_who_is_met(drive)) << "only x is stated";
  DriveLimitsOptions options;
  options.speeds = 0;
  EXPECT_THROW(drive_limits(crossing_drive(), crossing_sensor(), options), Error);
}

}  // namespace
}  // namespace blindcorner
