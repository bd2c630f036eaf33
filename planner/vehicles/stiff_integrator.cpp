// SPDX-License-Identifier: Apache-2.0
/// The only file that includes Boost.Odeint.
#include <algorithm>
#include <boost/numeric/odeint/stepper/rosenbrock4.hpp>
#include <boost/numeric/odeint/stepper/rosenbrock4_controller.hpp>
#include <boost/numeric/ublas/matrix.hpp>
#include <boost/numeric/ublas/vector.hpp>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "blindcorner/forward/error.h"
#include "blindcorner/planner/vehicles/integrator.h"
#include "planner/require_positive.h"

namespace blindcorner {
namespace {

namespace odeint = boost::numeric::odeint;
using Vector = boost::numeric::ublas::vector<double>;
using Matrix = boost::numeric::ublas::matrix<double>;

/// Where the equations jump (at a limit, between two models), no inner step passes the error test.
/// An inner step of this share of the step is then taken explicitly. Its error is at most the jump
/// times its length (1e-7 s for a step of 0.1 s), and it is far below the fastest time constant
/// (about 1e-5 s).
constexpr double kShortestShare = 1e-6;
/// Largest number of inner steps. Harsh steps of the car take some 50; equations that take this
/// many have no solution.
constexpr int kMaxInnerSteps = 20'000;
/// Relative step of forward differences: the errors of rounding and of the quotient are about
/// equal.
const double kDifference = std::sqrt(std::numeric_limits<double>::epsilon());

StateVector from(const Vector& x) {
  return Eigen::Map<const Eigen::VectorXd>(&x[0], static_cast<Eigen::Index>(x.size()));
}

void copy(const StateVector& from, Vector& to) { std::copy(from.begin(), from.end(), to.begin()); }

/// df/dx by forward differences. Positions, which come first, do not appear in equations of motion.
void jacobian(const RightHandSide& f, const StateVector& x, Matrix& result) {
  result.clear();
  const StateVector middle = f(x);
  StateVector moved = x;
  for (Eigen::Index column = 2; column < x.size(); ++column) {
    const double h = kDifference * std::max(std::abs(x[column]), 1.0);
    moved[column] = x[column] + h;
    const StateVector slope = (f(moved) - middle) / (moved[column] - x[column]);
    moved[column] = x[column];
    for (Eigen::Index row = 0; row < x.size(); ++row) {
      result(static_cast<std::size_t>(row), static_cast<std::size_t>(column)) = slope[row];
    }
  }
}

[[noreturn]] void fail(double time, double dt) {
  throw Error("vehicle: its equations of motion have no finite solution beyond " +
              std::to_string(time) + " s of a step of " + std::to_string(dt) + " s");
}

class Rosenbrock : public Integrator {
 public:
  explicit Rosenbrock(const IntegratorTolerance& tolerance) : tolerance_(tolerance) {
    tolerance.validate();
  }

  StateVector advance(const RightHandSide& f, const StateVector& x, double dt) const override {
    const auto system = [&](const Vector& at, Vector& slope, double) { copy(f(from(at)), slope); };
    const auto slopes = [&](const Vector& at, Matrix& result, double, Vector& in_time) {
      jacobian(f, from(at), result);
      in_time.clear();
    };
    odeint::rosenbrock4_controller<odeint::rosenbrock4<double>> stepper(tolerance_.absolute,
                                                                        tolerance_.relative);
    Vector now(static_cast<std::size_t>(x.size()));
    copy(x, now);
    const double shortest = kShortestShare * dt;
    double time = 0, inner = dt;
    int inner_steps = 0;
    while (dt - time > shortest) {
      if (++inner_steps > kMaxInnerSteps) fail(time, dt);
      inner = std::min(inner, dt - time);
      const double asked = inner;
      if (stepper.try_step(std::make_pair(system, slopes), now, time, inner) == odeint::success) {
        continue;
      }
      // Infinite estimates leave the proposed step undefined.
      if (!(inner < asked)) inner = 0.1 * asked;
      if (inner > shortest) continue;
      const StateVector at = from(now);
      copy(at + shortest * f(at), now);
      time += shortest, inner = 10 * shortest;
    }
    StateVector end = from(now);
    if (!end.allFinite()) fail(time, dt);
    return end;
  }

 private:
  IntegratorTolerance tolerance_;
};

}  // namespace

void IntegratorTolerance::validate() const {
  require_positive("IntegratorTolerance", "absolute", absolute);
  require_positive("IntegratorTolerance", "relative", relative);
}

std::shared_ptr<const Integrator> make_stiff_integrator(const IntegratorTolerance& tolerance) {
  return std::make_shared<Rosenbrock>(tolerance);
}

}  // namespace blindcorner
