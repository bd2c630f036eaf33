// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/vehicles/differential_drive.h"

#include <gtest/gtest.h>

#include <cmath>

#include "blindcorner/forward/constants.h"
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

TEST(DifferentialDrive, TurnsOnTheSpot) {
  Vehicle robot(make_differential_drive());
  for (int i = 0; i < 10; ++i) robot.step(DriveRequest{0, 5}, 0.1);
  EXPECT_NEAR(robot.state().yaw_rate, 1.0, 1e-6);  // 5/m at 0.2 m/s
  EXPECT_LT(robot.state().position.norm(), 1e-9);
}

}  // namespace
}  // namespace blindcorner
