// SPDX-License-Identifier: Apache-2.0
/// The only file that sees Boost.
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
#include "planner/vehicles/single_track_limits.h"

namespace blindcorner {
namespace {

namespace odeint = boost::numeric::odeint;
using Vector = boost::numeric::ublas::vector<double>;
using Matrix = boost::numeric::ublas::matrix<double>;

/// Inner steps shorter than this share of the step mean that the equations have no solution there.
constexpr double kShortestShare = 1e-9;
/// Forward differences: error of rounding and of the quotient are about equal.
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
    Vector now(static_cast<std::size_t>(x.size())), before(now.size());
    copy(x, now);
    double time = 0, inner = dt;
    while (time < dt) {
      // The last step ends where asked, whatever rounding makes of the sum.
      const bool last = time + inner >= dt * (1 - kShortestShare);
      const double start = time;
      if (last) inner = dt - time;
      before = now;
      const auto result = stepper.try_step(std::make_pair(system, slopes), now, time, inner);
      if (!from(now).allFinite()) {  // too far outside: like a step that is refused
        now = before, time = start, inner *= 0.1;
      } else if (result == odeint::success && last) {
        break;
      }
      if (inner < kShortestShare * dt) {
        throw Error("vehicle: no solution after " + std::to_string(time) + " s of a step of " +
                    std::to_string(dt) + " s");
      }
    }
    return from(now);
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
