// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/vehicles/single_track.h"

#include <gtest/gtest.h>

#include <cmath>

#include "blindcorner/planner/vehicles/kinematic_single_track.h"
#include "blindcorner/planner/vehicles/vehicle.h"

namespace blindcorner {
namespace {

TEST(SingleTrack, TurnsAsItsUndersteerGradientSays) {
  // Steady state: steering = wheelbase / R + K v^2 / R, K = (1/C_front - 1/C_rear) / (mu g).
  const SingleTrackParameters parameters;
  SingleTrackTyres tyres;
  tyres.front_stiffness = 15;
  tyres.rear_stiffness = 20;
  const double gradient = (1 / tyres.front_stiffness - 1 / tyres.rear_stiffness) /
                          (tyres.friction * kGravity);  // s^2/m
  for (const double speed : {2.0, 6.0, 12.0}) {
    Vehicle car(make_single_track(parameters, tyres));
    car.place({.speed = speed, .steering_angle = 0.02});
    for (int i = 0; i < 500; ++i) car.step(VehicleCommand{}, 0.01);
    const double yaw_rate = speed * 0.02 / (parameters.wheelbase() + gradient * speed * speed);
    EXPECT_NEAR(car.state().yaw_rate, yaw_rate, 1e-5 * yaw_rate) << speed;
  }
}

TEST(KinematicSingleTrack, RollsOnACircle) {
  const SingleTrackParameters parameters;
  Vehicle car(make_kinematic_single_track(parameters));
  car.place({.speed = 5, .steering_angle = 0.3});
  for (int i = 0; i < 50; ++i) car.step(VehicleCommand{}, 0.1);
  const double radius = parameters.wheelbase() / std::tan(0.3), angle = 25 / radius;
  const Eigen::Vector2d wanted(radius * std::sin(angle), radius * (1 - std::cos(angle)));
  EXPECT_LT((car.state().position - wanted).norm(), 1e-4);
}

TEST(KinematicSingleTrack, SteersNoFurtherThanItsStop) {
  Vehicle car(make_kinematic_single_track());
  for (int i = 0; i < 100; ++i) car.step(VehicleCommand{0, 1}, 0.1);
  EXPECT_NEAR(car.state().steering_angle, SingleTrackParameters{}.steering_angle, 1e-5);
}

TEST(KinematicSingleTrack, ReachesARequestedCurvature) {
  Vehicle car(make_kinematic_single_track());
  car.place({.speed = 3});
  for (int i = 0; i < 20; ++i) car.step(DriveRequest{0, 0.1}, 0.1);
  EXPECT_NEAR(car.state().yaw_rate / car.state().speed, 0.1, 1e-9);
}

}  // namespace
}  // namespace blindcorner
