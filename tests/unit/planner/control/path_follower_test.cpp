// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/control/path_follower.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/planner/vehicles/vehicle.h"
#include "unit/planner/control/test_paths.h"

namespace blindcorner {
namespace {

constexpr double kFrame = 0.1;  // s, the sensor's

struct Drive {
  double worst_offset = 0;  // m, until 1 m before the path's end
  double final_miss = 0;    // m, from the path's end
  bool arrived = false;
  VehicleState end;
};

Drive drive(Vehicle vehicle, const std::vector<PathPoint>& path, const PathFollowerOptions& options,
            double seconds = 60) {
  PathFollower follower(path, vehicle.model().limits(), vehicle.state(), options);
  Drive drive;
  for (double time = 0; time < seconds && !drive.arrived; time += kFrame) {
    const FollowerOutput output = follower.follow(vehicle.state());
    if (output.arc_length < path.back().arc_length - 1) {
      drive.worst_offset = std::max(drive.worst_offset, std::abs(output.offset));
    }
    drive.arrived = output.at_end;
    vehicle.step(output.request, kFrame);
  }
  drive.end = vehicle.state();
  drive.final_miss = (drive.end.position - path.back().position).norm();
  return drive;
}

Vehicle car_at(double speed) {
  Vehicle car(make_vehicle_model("car"));
  car.place({.speed = speed});
  return car;
}

/// The speed of the trial, whatever the curve.
PathFollowerOptions at_speed(double speed) {
  PathFollowerOptions options;
  options.profile.speed = speed;
  options.profile.cornering = std::numeric_limits<double>::infinity();
  return options;
}

// Offsets are those of the steering, which takes 0.43 s (4.3 m at 10 m/s) to the curve's angle,
// and of the controller's 10 Hz; beyond 10 m/s tyres that near their limit turn the car too late.
TEST(PathFollower, TurnsTheCorner) {
  for (const auto& [speed, error] : {std::pair{2.0, 0.05},
                                     {6.0, 0.1},
                                     {8.0, 0.1},
                                     {9.0, 0.15},
                                     {10.0, 0.25},
                                     {10.5, 0.8},
                                     {11.0, 2.5}}) {
    const Drive left = drive(car_at(speed), l_turn(15, 30, 0.25), at_speed(speed));
    EXPECT_LT(left.worst_offset, error) << speed;
    const Drive right = drive(car_at(speed), mirrored(l_turn(15, 30, 0.25)), at_speed(speed));
    EXPECT_NEAR(right.worst_offset, left.worst_offset, 5e-3) << speed;
    if (speed > 10) continue;  // 30 m after the corner are too short to come back
    EXPECT_TRUE(left.arrived) << speed;
    EXPECT_LT(left.final_miss, 0.15) << speed;
  }
}

TEST(PathFollower, CannotTurnFasterThanFriction) {
  // sqrt(mu g r) = 11.5 m/s.
  const Drive above = drive(car_at(12.5), l_turn(15, 30, 0.25), at_speed(12.5), 8);
  EXPECT_GT(above.worst_offset, 3);
  // With the curve in the profile the car slows down before it.
  PathFollowerOptions slowing;
  slowing.profile.speed = 12.5;
  slowing.profile.cornering = 0.7;
  const Drive slower = drive(car_at(12.5), l_turn(15, 40, 0.25), slowing);
  EXPECT_LT(slower.worst_offset, 0.3);
  EXPECT_TRUE(slower.arrived);
}

TEST(PathFollower, KeepsToACircle) {
  // Eight turns after the entry: what is left is steady.
  const auto path = turn_path(15, 5, 16 * kPi, 0, 0.25);
  for (const double speed : {2.0, 6.0, 9.0}) {
    EXPECT_LT(drive(car_at(speed), path, at_speed(speed), 300).worst_offset, 0.2) << speed;
  }
}

TEST(PathFollower, ReturnsToThePath) {
  for (const double offset : {-1.5, 1.5}) {
    Vehicle car(make_vehicle_model("car"));
    car.place({.position = {0, offset}, .speed = 8});
    const Drive back = drive(car, straight_path(80, 0.5), at_speed(8));
    EXPECT_NEAR(back.end.position.y(), 0, 0.01);
    EXPECT_TRUE(back.arrived);
  }
}

TEST(PathFollower, StartsFromStandstillAndStopsAtTheEnd) {
  const Drive whole = drive(car_at(0), straight_path(30, 0.5), at_speed(8));
  EXPECT_TRUE(whole.arrived);
  EXPECT_LT(whole.final_miss, 0.15);
}

TEST(PathFollower, LeadsTheRobotThroughItsCorridor) {
  Vehicle robot(make_vehicle_model("robot"));
  const VehicleLimits limits = robot.model().limits();
  PathFollowerOptions options = follower_options(limits);
  options.profile.speed = 1;
  const Drive turned = drive(robot, l_turn(0.5, 1, 0.02), options);
  EXPECT_TRUE(turned.arrived);
  EXPECT_LT(turned.worst_offset, 0.06);
  // A path that begins behind it: it turns first.
  robot.place({.yaw = kPi * 0.9});
  EXPECT_TRUE(drive(robot, straight_path(2, 0.05), options).arrived);
}

TEST(PathFollower, StopsBesideTheFrictionThatSteeringNeeds) {
  Vehicle car = car_at(9);
  const auto path = l_turn(15, 5, 0.25);
  PathFollower follower(path, car.model().limits(), car.state(), at_speed(9));
  double time = 0;
  for (; time < 1.2; time += kFrame) car.step(follower.follow(car.state()).request, kFrame);
  const Eigen::Vector2d from = car.state().position;
  const double speed = car.state().speed;
  double worst = 0;
  for (; time < 6; time += kFrame) {
    const FollowerOutput output = follower.stop(car.state());
    worst = std::max(worst, std::abs(output.offset));
    car.step(output.request, kFrame);
  }
  EXPECT_NEAR(car.state().speed, 0, 1e-6);
  EXPECT_LT(worst, 0.5);
  // Half of the circle's square at least: sqrt(1/2) of the deceleration.
  const double shortest = speed * speed / (2 * 0.9 * 9.81);
  EXPECT_LT((car.state().position - from).norm(), std::sqrt(2.0) * shortest + 0.5);
}

TEST(PathFollower, WhoIsTooFastForALimitIsNotDrivenOnByWhatComesAfterIt) {
  const auto path = straight_path(50, 0.25);
  const Vehicle car = car_at(3);
  const auto acceleration = [&](const std::vector<double>& limits) {
    PathFollower follower(path, car.model().limits(), car.state(), at_speed(8));
    follower.limit_speed(limits, car.state());
    return follower.follow(car.state()).request.acceleration;
  };
  std::vector<double> limits(path.size(), 8);
  limits[0] = 2;  // the profile rises again after it
  EXPECT_LT(acceleration(limits), -1);
  limits[0] = 3;
  EXPECT_GT(acceleration(limits), 1);
}

TEST(SafeStop, BrakesAtTheFrictionLimit) {
  Vehicle car = car_at(10);
  for (int i = 0; i < 30; ++i) {
    car.step(safe_stop(car.state(), car.model().limits()), kFrame);
  }
  EXPECT_NEAR(car.state().position.x(), 100 / (2 * 0.9 * 9.81), 0.12);
  EXPECT_NEAR(car.state().speed, 0, 1e-6);
}

TEST(PathFollower, RefusesPathsWithoutDirection) {
  EXPECT_THROW(PathFollower({PathPoint{}}, {}, {}), Error);
}

}  // namespace
}  // namespace blindcorner
