// SPDX-License-Identifier: Apache-2.0
/// Ways to integrate a vehicle's equations of motion over a step.
#pragma once

#include <functional>
#include <memory>

#include "blindcorner/planner/vehicles/vehicle_model.h"

namespace blindcorner {

/// f(x) of dx/dt = f(x): commands are held during a step, so time does not appear.
using RightHandSide = std::function<StateVector(const StateVector&)>;

class Integrator {
 public:
  virtual ~Integrator() = default;
  /// x(dt) from x(0) = `x`.
  virtual StateVector advance(const RightHandSide& f, const StateVector& x, double dt) const = 0;
};

/// Local error that an inner step may have: absolute + relative |x| in each state, root mean square
/// over the states. In the states' units (m, rad, m/s, rad/s).
struct IntegratorTolerance {
  /// Measured for the car: 0.001 mm after 2 s of harsh commands (`blindcorner benchmark vehicles`).
  double absolute = 1e-6;
  double relative = 1e-6;

  void validate() const;
};

/// Rosenbrock's method of order 4 (Boost.Odeint), L-stable, inner steps chosen by its embedded
/// error estimate. Throws Error when the equations have no finite solution. Chosen by measurement:
/// for the car at steps of 1 to 100 ms SUNDIALS' CVODE (BDF) took 1.4 to 3.6 times as long and
/// ARKODE (DIRK, order 4) 7 to 16 times, at the same tolerance and nearly always with larger
/// errors: commands that are held for a step make methods with a memory, and Newton's iterations,
/// start again in each.
std::shared_ptr<const Integrator> make_stiff_integrator(const IntegratorTolerance& tolerance = {});

/// One explicit step over all of dt, for comparisons: unstable where dt exceeds 2 (Euler) or 2.8
/// (Runge and Kutta's of order 4) of the fastest time constant. States may become infinite.
std::shared_ptr<const Integrator> make_euler_integrator();
std::shared_ptr<const Integrator> make_rk4_integrator();

}  // namespace blindcorner
