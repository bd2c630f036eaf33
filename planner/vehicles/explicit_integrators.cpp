// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/vehicles/integrator.h"

namespace blindcorner {
namespace {

class Euler : public Integrator {
 public:
  StateVector advance(const RightHandSide& f, const StateVector& x, double dt) const override {
    return x + dt * f(x);
  }
};

class RungeKutta4 : public Integrator {
 public:
  StateVector advance(const RightHandSide& f, const StateVector& x, double dt) const override {
    const StateVector k1 = f(x);
    const StateVector k2 = f(x + dt / 2 * k1);
    const StateVector k3 = f(x + dt / 2 * k2);
    const StateVector k4 = f(x + dt * k3);
    return x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
  }
};

}  // namespace

std::shared_ptr<const Integrator> make_euler_integrator() { return std::make_shared<Euler>(); }

std::shared_ptr<const Integrator> make_rk4_integrator() { return std::make_shared<RungeKutta4>(); }

}  // namespace blindcorner
