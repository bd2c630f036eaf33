// SPDX-License-Identifier: Apache-2.0
/// Methods to integrate a vehicle's equations of motion over a step.
#pragma once

#include <functional>
#include <memory>

#include "blindcorner/planner/vehicles/vehicle_model.h"

namespace blindcorner {

/// f(x) of dx/dt = f(x). Commands are held during a step, so time does not appear.
using RightHandSide = std::function<StateVector(const StateVector&)>;

class Integrator {
 public:
  virtual ~Integrator() = default;
  /// x(dt) from x(0) = `x`.
  virtual StateVector advance(const RightHandSide& f, const StateVector& x, double dt) const = 0;
};

/// Allowed local error of an inner step: absolute + relative |x| in each state, root mean square
/// over the states. In the states' units (m, rad, m/s, rad/s).
struct IntegratorTolerance {
  /// Measured for the car: 0.001 mm after 2 s of harsh commands (`blindcorner benchmark vehicles`).
  double absolute = 1e-6;
  double relative = 1e-6;

  void validate() const;
};

/// Rosenbrock's method of order 4 (Boost.Odeint). It is L-stable and chooses inner steps by its
/// embedded error estimate. Throws Error when the equations have no finite solution. Chosen by
/// measurement: for the car at steps of 1 to 100 ms, SUNDIALS' CVODE (BDF) took 1.4 to 3.6 times as
/// long and ARKODE (DIRK, order 4) 7 to 16 times as long, at the same tolerance and nearly always
/// with larger errors. The reason is that commands are held for a step: methods with a memory, and
/// Newton's iterations, must start again in each step.
std::shared_ptr<const Integrator> make_stiff_integrator(const IntegratorTolerance& tolerance = {});

/// One explicit step over the whole dt, for comparisons: unstable where dt exceeds 2 (Euler) or 2.8
/// (fourth-order Runge-Kutta) times the fastest time constant. States may become infinite.
std::shared_ptr<const Integrator> make_euler_integrator();
std::shared_ptr<const Integrator> make_rk4_integrator();

}  // namespace blindcorner
