// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/vehicles/car.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "blindcorner/forward/error.h"
#include "blindcorner/planner/vehicles/vehicle.h"

namespace blindcorner {
namespace {

constexpr double kLimit = 0.9 * kGravity;  // mu g, m/s^2

Vehicle car_driving_at(double speed) {
  Vehicle car(make_car());
  car.place({.speed = speed});
  return car;
}

/// Acceleration of the centre of gravity in the car's frame, m/s^2.
Eigen::Vector2d acceleration_of(const Vehicle& car, const VehicleCommand& command) {
  const StateVector& x = car.states();
  const StateVector dx = car.model().derivative(x, command);
  return {dx[3] - x[4] * x[5], dx[4] + x[3] * x[5]};
}

/// Steers to the angle of a radius and lets the motion settle, speed held.
Vehicle on_circle(double radius, double speed) {
  Vehicle car = car_driving_at(speed);
  for (int i = 0; i < 600; ++i) {
    car.step(DriveRequest{2 * (speed - car.state().speed), 1 / radius}, 0.01);
  }
  return car;
}

TEST(Car, BrakesWithinTheFrictionLimit) {
  for (const double speed : {3.0, 6.0, 12.0}) {
    Vehicle car = car_driving_at(speed);
    double hardest = 0;
    for (int i = 0; i < 1000; ++i) {
      car.step(VehicleCommand{-kLimit, 0}, 0.002);
      hardest = std::max(hardest, -acceleration_of(car, {-kLimit, 0}).x());
    }
    const double shortest = speed * speed / (2 * kLimit);
    EXPECT_LE(hardest, kLimit * (1 + 1e-9));
    EXPECT_GE(car.state().position.x(), shortest);
    // The wheels slow down for some 10 ms before the tyres hold, and the steady deceleration is
    // 0.5 % below the limit.
    EXPECT_LE(car.state().position.x(), 1.006 * shortest + 0.01 * speed) << speed;
    EXPECT_NEAR(car.state().speed, 0, 1e-6);
  }
}

TEST(Car, FollowsCommandedAccelerations) {
  for (const double wanted : {-4.0, -1.0, 1.0, 3.0}) {
    Vehicle car = car_driving_at(6);
    for (int i = 0; i < 10; ++i) car.step(VehicleCommand{wanted, 0}, 0.05);
    // Slip grows with the wheels' speed, which takes a little of what the wheels were given.
    EXPECT_NEAR(acceleration_of(car, {wanted, 0}).x(), wanted, 0.02 * std::abs(wanted));
  }
}

TEST(Car, RollsOnTheKinematicCircleWhenSlow) {
  const double radius = 15;
  const Vehicle car = on_circle(radius, 1);
  const VehicleState state = car.state();
  // Side slip at 1 m/s: v^2 / (r g stiffness) = 0.3 mrad at both axles, which cancels in the
  // radius.
  EXPECT_NEAR(state.speed / state.yaw_rate, radius, 0.001 * radius);
}

// Paths are looked at with the car pointing as it does without slip (yaw_on_path). It is off by the
// rear tyres' slip s. Of a brush tyre of stiffness C the share of the friction limit mu that is
// used is 1 - (1 - s / s0)^3 with s0 = 3 mu / C.
TEST(Car, PointsOutOfItsCircle) {
  const CarParameters parameters;
  for (const double speed : {1.0, 4.0, 8.0, 10.0}) {
    const VehicleState state = on_circle(15, speed).state();
    const double curvature = state.yaw_rate / state.speed;
    const double yaw = yaw_on_path(state.course(), curvature, parameters.body.rear_axle);
    const double used = speed * speed * curvature / kLimit;
    const double slip =
        3 * parameters.friction / parameters.slip_stiffness * (1 - std::cbrt(1 - used));
    // Drive force takes a little more of the tyres, as above.
    EXPECT_NEAR(state.yaw - yaw, slip, 0.03 * slip + 1e-4) << speed;
  }
}

TEST(Car, IsNeutralUpToItsLimit) {
  // Equal tyres at both axles: the steering angle of a radius does not depend on the speed.
  for (const double speed : {4.0, 8.0, 10.5}) {
    const VehicleState state = on_circle(15, speed).state();
    // Drive force tilts the balance a little: 3 % at 0.83 of the limit.
    EXPECT_NEAR(state.speed / state.yaw_rate, 15, 0.03 * 15) << speed;
  }
}

TEST(Car, CannotCornerBeyondItsFriction) {
  // sqrt(mu g r) = 11.5 m/s at 15 m. Beyond, the circle widens.
  Vehicle car = car_driving_at(14);
  for (int i = 0; i < 200; ++i) {
    const DriveRequest request{2 * (14 - car.state().speed), 1 / 15.0};
    car.step(request, 0.01);
    EXPECT_LE(acceleration_of(car, {}).norm(), kLimit * (1 + 1e-9));
  }
  EXPECT_GT(car.state().speed / car.state().yaw_rate, 16);
}

TEST(Car, EnergyNeverGrowsWithoutThrottle) {
  for (const double brake : {0.0, -3.0, -9.0}) {
    for (const double dt : {0.001, 0.01, 0.1}) {
      Vehicle car = car_driving_at(12);
      double energy = car.model().energy(car.states());
      // The integrator's, 1e-6 in speed: a step's, and what steps may add up to.
      const double tolerance = 1e-5 * energy;
      double gained = 0;
      for (int i = 0; i * dt < 5; ++i) {
        car.step(VehicleCommand{brake, i * dt < 2.5 ? 0.4 : -0.4}, dt);
        const double now = car.model().energy(car.states());
        EXPECT_LE(now, energy + tolerance) << brake << ", " << dt;
        gained += std::max(now - energy, 0.0);
        energy = now;
      }
      EXPECT_LE(gained, 10 * tolerance) << brake << ", " << dt;
    }
  }
}

TEST(Car, SlipStiffnessIsLowerBelowTheSlipSpeed) {
  // At wheel speed V, stiffness is lower by V / sqrt(V^2 + e^2): e^2 / (2 V^2) = 0.5 % at 1 m/s.
  const auto model = make_car();
  const auto lateral = [&](double speed) {
    const VehicleState state{.speed = speed, .slip_angle = 1e-4};
    const StateVector x = model->initial(state);
    return model->derivative(x, {})[4] / state.slip_angle;
  };
  EXPECT_NEAR(lateral(1.0) / lateral(100.0), 1 / std::sqrt(1.01), 1e-3);
}

TEST(Car, StartsFromStandstill) {
  Vehicle car = car_driving_at(0);
  for (int i = 0; i < 20; ++i) car.step(DriveRequest{2, 0}, 0.1);
  EXPECT_NEAR(car.state().speed, 4, 0.1);
  EXPECT_NEAR(car.state().position.x(), 4, 0.1);
}

TEST(Car, SpinningWheelsAreHeldAtTheFrictionLimit) {
  Vehicle car = car_driving_at(0);
  for (int i = 0; i < 20; ++i) car.step(VehicleCommand{11, 0}, 0.05);
  const double most = car.model().limits().acceleration;
  EXPECT_LE(car.state().speed, most * 1.001);
  EXPECT_GE(car.state().speed, 0.93 * most);
  EXPECT_LT(0.344 * car.states()[8], 1.5 * car.state().speed);
}

TEST(CarParameters, NamesWhatIsWrong) {
  CarParameters parameters;
  parameters.friction = 0;
  EXPECT_THROW(make_car(parameters), Error);
}

}  // namespace
}  // namespace blindcorner
