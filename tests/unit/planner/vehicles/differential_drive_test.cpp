// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/vehicles/differential_drive.h"

#include <gtest/gtest.h>

#include <cmath>

#include "blindcorner/forward/constants.h"
#include "blindcorner/planner/control/path_follower.h"
#include "blindcorner/planner/vehicles/vehicle.h"

namespace blindcorner {
namespace {

TEST(DifferentialDrive, DrivesAnArc) {
  const double speed = 0.8, yaw_rate = 1.1, seconds = 3;
  for (const double dt : {0.001, 0.01, 0.1}) {
    Vehicle robot(make_differential_drive());
    robot.place({.speed = speed, .yaw_rate = yaw_rate});
    for (int i = 0; i < std::lround(seconds / dt); ++i) robot.step(VehicleCommand{}, dt);
    const double radius = speed / yaw_rate, angle = yaw_rate * seconds;
    const Eigen::Vector2d wanted(radius * std::sin(angle), radius * (1 - std::cos(angle)));
    EXPECT_LT((robot.state().position - wanted).norm(), 1e-5) << dt;
    EXPECT_NEAR(robot.state().yaw, angle, 1e-9) << dt;
  }
}

TEST(DifferentialDrive, KeepsItsWheelsLimits) {
  const DifferentialDriveParameters parameters;
  Vehicle robot(make_differential_drive(parameters));
  for (int i = 0; i < 100; ++i) robot.step(VehicleCommand{100, 10}, 0.1);
  EXPECT_LE(robot.states().tail<2>().cwiseAbs().maxCoeff(), parameters.wheel_speed + 1e-5);
}

// Half of the wheels' acceleration brakes at least, however hard the turn: each wheel clipped by
// itself left 0.8 of 2 m/s^2 here.
TEST(DifferentialDrive, BrakesWhileItTurns) {
  const DifferentialDriveParameters parameters;
  const auto model = make_differential_drive(parameters);
  const StateVector moving = model->initial({.speed = 1.0, .yaw_rate = 2.0});
  const VehicleCommand command =
      model->command(moving, {.acceleration = -parameters.acceleration, .curvature = 0}, 0.1);
  const StateVector change = model->derivative(moving, command);
  EXPECT_LE(0.5 * (change[3] + change[4]), -0.5 * parameters.acceleration + 1e-9);
  EXPECT_GT(change[3] - change[4], 0);  // and turns less to the left
}

// Wheels keep the ratio of their speeds.
TEST(DifferentialDrive, ASafeStopKeepsTheCurve) {
  Vehicle robot(make_differential_drive());
  robot.place({.speed = 0.9, .yaw_rate = 0.9});
  const double curvature = 1.0;
  while (robot.state().speed > 0.3) {
    robot.step(safe_stop(robot.state(), robot.model().limits()), 0.02);
    EXPECT_NEAR(robot.state().yaw_rate / robot.state().speed, curvature, 0.03);
  }
}

TEST(DifferentialDrive, TurnsOnTheSpot) {
  Vehicle robot(make_differential_drive());
  for (int i = 0; i < 10; ++i) robot.step(DriveRequest{0, 5}, 0.1);
  EXPECT_NEAR(robot.state().yaw_rate, 1.0, 1e-6);  // 5/m at 0.2 m/s
  EXPECT_LT(robot.state().position.norm(), 1e-9);
}

}  // namespace
}  // namespace blindcorner
