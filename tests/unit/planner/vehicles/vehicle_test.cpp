// SPDX-License-Identifier: Apache-2.0
/// What holds for every vehicle that drives are made with.
#include "blindcorner/planner/vehicles/vehicle.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

constexpr double kInputPeriod = 0.1;  // s

/// Full brakes, throttle and steering in any order, each held for 0.1 s.
std::vector<VehicleCommand> harsh_commands(int count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> acceleration(-12, 6), steering(-0.4, 0.4);
  std::vector<VehicleCommand> commands(static_cast<std::size_t>(count));
  for (VehicleCommand& command : commands) {
    command = {std::clamp(acceleration(random), -9.0, 5.0), steering(random)};
  }
  return commands;
}

Vehicle at_speed(const std::string& name, double speed) {
  Vehicle vehicle(make_vehicle_model(name));
  vehicle.place({.speed = speed});
  return vehicle;
}

VehicleState driven(Vehicle vehicle, const std::vector<VehicleCommand>& commands, double dt) {
  for (const VehicleCommand& command : commands) {
    const auto steps = std::lround(kInputPeriod / dt);
    for (long i = 0; i < steps; ++i) vehicle.step(command, dt);
  }
  return vehicle.state();
}

TEST(VehicleModels, AreMadeByName) {
  for (const std::string& name : vehicle_model_names()) {
    const auto model = make_vehicle_model(name);
    EXPECT_EQ(model->name(), name);
    EXPECT_EQ(static_cast<std::size_t>(model->initial({}).size()), model->state_names().size());
    EXPECT_GT(model->footprint().length, 0);
    EXPECT_GT(model->limits().friction, 0);
  }
  EXPECT_THROW(make_vehicle_model("tank"), Error);
}

TEST(VehicleModels, TakeAndTellTheSameMotion) {
  const VehicleState wanted{.position = {3, -2}, .yaw = 0.7, .speed = 1.2};
  for (const std::string& name : vehicle_model_names()) {
    const auto model = make_vehicle_model(name);
    const VehicleState told = model->motion(model->initial(wanted));
    EXPECT_EQ(told.position, wanted.position) << name;
    EXPECT_DOUBLE_EQ(told.yaw, wanted.yaw) << name;
    EXPECT_DOUBLE_EQ(told.speed, wanted.speed) << name;
  }
}

TEST(Vehicle, StandsFor100SecondsAtAnyStep) {
  for (const char* name : {"car", "robot"}) {
    for (const double dt : {0.001, 0.003, 0.01, 0.033, 0.1}) {
      Vehicle vehicle = at_speed(name, 0);
      // The robot's steering would turn it, as it should.
      const double steering = std::string(name) == "robot" ? 0 : 0.02;
      for (int i = 0; i * dt < 100; ++i) vehicle.step(VehicleCommand{0, steering}, dt);
      EXPECT_LT(vehicle.state().position.norm(), 1e-12) << name << ", dt " << dt;
      EXPECT_LT(std::abs(vehicle.state().yaw), 1e-12) << name << ", dt " << dt;
    }
  }
}

TEST(Vehicle, HeldBrakesKeepTheCarWhereItStopped) {
  for (const double dt : {0.001, 0.01, 0.1}) {
    Vehicle car = at_speed("car", 5);
    for (int i = 0; i * dt < 2; ++i) car.step(VehicleCommand{-12, 0}, dt);
    const Eigen::Vector2d stopped = car.state().position;
    for (int i = 0; i * dt < 100; ++i) car.step(VehicleCommand{-12, 0}, dt);
    EXPECT_LT((car.state().position - stopped).norm(), 1e-6) << dt;
    EXPECT_LT(std::abs(car.state().speed), 1e-9) << dt;
  }
}

// Stability and accuracy at once: a step that were unstable at any speed would end elsewhere.
TEST(Vehicle, EveryStepLeadsToTheSamePlace) {
  for (const char* name : {"car", "robot"}) {
    for (const double speed : {0.0, 0.02, 0.3, 1.0, 3.0, 6.0, 9.0, 12.0}) {
      const auto commands = harsh_commands(30, 7);
      const Vehicle vehicle = at_speed(name, speed);
      const VehicleState wanted =
          driven(Vehicle([&] {
                   Vehicle exact(make_vehicle_model(name), make_stiff_integrator({1e-9, 1e-9}));
                   exact.place({.speed = speed});
                   return exact;
                 }()),
                 commands, 0.05);
      for (const double dt : {0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1}) {
        const VehicleState end = driven(vehicle, commands, dt);
        // 1 mm is what comparisons with other simulators ask for.
        EXPECT_LT((end.position - wanted.position).norm(), 1e-3)
            << name << " from " << speed << " m/s, dt " << dt;
      }
    }
  }
}

TEST(Vehicle, LeftAndRightAreMirrorImages) {
  for (const char* name : {"car", "robot"}) {
    auto commands = harsh_commands(30, 3);
    const VehicleState left = driven(at_speed(name, 8), commands, 0.02);
    for (VehicleCommand& command : commands) command.steering = -command.steering;
    const VehicleState right = driven(at_speed(name, 8), commands, 0.02);
    EXPECT_NEAR(left.position.x(), right.position.x(), 1e-6) << name;
    EXPECT_NEAR(left.position.y(), -right.position.y(), 1e-6) << name;
    EXPECT_NEAR(left.yaw, -right.yaw, 1e-6) << name;
  }
}

TEST(Vehicle, RequestsNeverDriveBackwards) {
  for (const std::string& name : vehicle_model_names()) {
    Vehicle vehicle = at_speed(name, 1.0);
    for (int i = 0; i < 30; ++i) vehicle.step(DriveRequest{-5, 0}, 0.1);
    EXPECT_NEAR(vehicle.state().speed, 0, 1e-6) << name;
  }
}

TEST(Vehicle, RefusesNonsense) {
  Vehicle car = at_speed("car", 1);
  EXPECT_THROW(car.step(VehicleCommand{}, 0), Error);
  EXPECT_THROW(car.step(VehicleCommand{}, -1), Error);
  EXPECT_THROW(car.step(VehicleCommand{std::nan(""), 0}, 0.1), Error);
}

TEST(VehicleFrame, LooksAlongYaw) {
  const Transform frame = T_world_vehicle({.position = {1, 2}, .yaw = kPi / 2});
  EXPECT_TRUE((frame * Eigen::Vector3d(1, 0, 0.5)).isApprox(Eigen::Vector3d(1, 3, 0.5)));
}

}  // namespace
}  // namespace blindcorner
