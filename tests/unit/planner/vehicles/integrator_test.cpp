// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/vehicles/integrator.h"

#include <gtest/gtest.h>

#include <cmath>

#include "blindcorner/forward/error.h"
#include "blindcorner/planner/vehicles/vehicle.h"

namespace blindcorner {
namespace {

/// x, y at rest, then a state that tends to 1 with a rate in 1/s.
RightHandSide decay(double rate) {
  return [rate](const StateVector& x) {
    StateVector dx = StateVector::Zero(3);
    dx[2] = -rate * (x[2] - 1);
    return dx;
  };
}

TEST(StiffIntegrator, FollowsFastAndSlowDecays) {
  const StateVector start = StateVector::Zero(3);
  for (const double rate : {0.1, 10.0, 1e3, 1e5, 1e7}) {
    const StateVector end = make_stiff_integrator()->advance(decay(rate), start, 0.1);
    // A few inner steps of the tolerance each.
    EXPECT_NEAR(end[2], 1 - std::exp(-rate * 0.1), 1e-5) << rate;
  }
}

TEST(StiffIntegrator, PassesJumps) {
  // A slope that jumps from 1 to 0 at 0.05. The error is the tolerance's: the root mean square over
  // three states.
  const RightHandSide f = [](const StateVector& x) {
    StateVector dx = StateVector::Zero(3);
    dx[2] = x[2] < 0.05 ? 1 : 0;
    return dx;
  };
  const StateVector end = make_stiff_integrator()->advance(f, StateVector::Zero(3), 0.1);
  EXPECT_NEAR(end[2], 0.05, 5e-6);
}

TEST(StiffIntegrator, SaysWhenThereIsNoSolution) {
  const RightHandSide f = [](const StateVector& x) {  // x = 1 / (1 - t) ends at 1 s
    StateVector dx = StateVector::Zero(3);
    dx[2] = (x[2] + 1) * (x[2] + 1);
    return dx;
  };
  EXPECT_THROW(make_stiff_integrator()->advance(f, StateVector::Zero(3), 2), Error);
  EXPECT_THROW(make_stiff_integrator({0, 1e-6}), Error);
}

/// Ratio of the errors at two steps, the second half of the first.
double order(const Integrator& integrator) {
  const auto error = [&](double step) {
    StateVector x = StateVector::Zero(3);
    for (int i = 0; i < std::lround(1 / step); ++i) x = integrator.advance(decay(1), x, step);
    return std::abs(x[2] - (1 - std::exp(-1.0)));
  };
  return std::log2(error(0.1) / error(0.05));
}

TEST(ExplicitIntegrators, HaveTheirOrders) {
  EXPECT_NEAR(order(*make_euler_integrator()), 1, 0.1);
  EXPECT_NEAR(order(*make_rk4_integrator()), 4, 0.1);
}

TEST(ExplicitIntegrators, BlowUpWhereTheStiffOneDoesNot) {
  // Wheels follow the car within 12 us at rest, 0.1 ms at 1 m/s.
  for (const auto& integrator : {make_euler_integrator(), make_rk4_integrator()}) {
    Vehicle car(make_vehicle_model("car"), integrator);
    car.place({.speed = 1});
    for (int i = 0; i < 20; ++i) car.step(VehicleCommand{-2, 0.1}, 0.01);
    Vehicle exact(make_vehicle_model("car"));
    exact.place({.speed = 1});
    for (int i = 0; i < 20; ++i) exact.step(VehicleCommand{-2, 0.1}, 0.01);
    // Friction is bounded, so the wheels spin to and fro instead of ever faster: they do not brake.
    EXPECT_NEAR(exact.state().speed, 0.6, 0.02);
    EXPECT_GT(std::abs(car.state().speed - exact.state().speed), 0.2);
  }
}

}  // namespace
}  // namespace blindcorner
