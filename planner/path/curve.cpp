// SPDX-License-Identifier: Apache-2.0
#include "planner/path/curve.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "blindcorner/forward/constants.h"

namespace blindcorner {
namespace {

/// Clothoids are integrated in steps of this share of the nodes' spacing.
constexpr double kStepShare = 0.25;
/// Number of Newton steps towards the end. Each step squares the error, in units of the step's
/// length.
constexpr int kNewtonSteps = 4;
/// Curvature step of numeric derivatives, in units of one over the curve's length.
constexpr double kDerivativeStep = 1e-5;
/// Price of a change of length, in units of a change of curvature times the square of the spacing.
/// It is low, so that the length is adjusted first.
constexpr double kLengthPrice = 1e-3;

Eigen::Vector2d direction(double heading) { return {std::cos(heading), std::sin(heading)}; }

PathPoint end_of(const Curve& curve) { return curve.points(kStepShare * curve.spacing).back(); }

/// Difference of the wanted end from the last point: x, y and, if it is wanted, heading.
Eigen::VectorXd missing(const PathPoint& last, const CurveEnd& end) {
  Eigen::VectorXd lack(end.heading ? 3 : 2);
  lack.head<2>() = end.position - last.position;
  if (end.heading) lack[2] = std::remainder(*end.heading - last.heading, 2 * kPi);
  return lack;
}

/// [2 or 3, nodes] Derivatives of the end with respect to the curvatures of nodes 1, 2, ... and the
/// length.
Eigen::MatrixXd end_derivatives(const Curve& curve, const CurveEnd& end) {
  const auto nodes = static_cast<Eigen::Index>(curve.curvature.size());
  const PathPoint last = end_of(curve);
  const Eigen::VectorXd lack = missing(last, end);
  Eigen::MatrixXd derivatives(lack.size(), nodes);
  const double step = kDerivativeStep / curve.length;
  for (Eigen::Index i = 1; i < nodes; ++i) {
    Curve bent = curve;
    bent.curvature[static_cast<std::size_t>(i)] += step;
    derivatives.col(i - 1) = (lack - missing(end_of(bent), end)) / step;
  }
  derivatives.col(nodes - 1).setZero();
  derivatives.col(nodes - 1).head<2>() = direction(last.heading);
  if (end.heading) derivatives(2, nodes - 1) = last.curvature;
  return derivatives;
}

}  // namespace

PathPoint advanced(const PathPoint& from, double curvature, double length) {
  const double middle = from.heading + length * (3 * from.curvature + curvature) / 8;
  PathPoint to;
  to.heading = from.heading + length * (from.curvature + curvature) / 2;
  // Simpson's rule. Its error is 1e-3 of the length for a quarter turn, and 1e-8 for 0.1 rad.
  to.position =
      from.position +
      length / 6 * (direction(from.heading) + 4 * direction(middle) + direction(to.heading));
  to.curvature = curvature;
  to.arc_length = from.arc_length + length;
  return to;
}

double Curve::curvature_at(double arc_length) const {
  const double place =
      std::clamp(arc_length / spacing, 0.0, static_cast<double>(curvature.size() - 1));
  const auto node = std::min(static_cast<std::size_t>(place), curvature.size() - 2);
  const double share = place - static_cast<double>(node);
  return curvature[node] + share * (curvature[node + 1] - curvature[node]);
}

std::vector<PathPoint> Curve::points(double at_most) const {
  const double wanted = std::min(at_most, length);
  const auto fine = std::max(1.0, std::ceil(at_most / (kStepShare * spacing)));
  std::vector<PathPoint> points{start};
  points.front().arc_length = 0;
  points.front().curvature = curvature.front();
  const auto count = static_cast<int>(std::ceil(length / std::max(wanted, 1e-9) - 1e-9));
  for (int i = 1; i <= count; ++i) {
    const double from = points.back().arc_length;
    const double to = length * i / count;
    PathPoint point = points.back();
    for (double k = 1; k <= fine; ++k) {
      const double next = from + (to - from) * k / fine;
      point = advanced(point, curvature_at(next), next - point.arc_length);
    }
    point.arc_length = to;
    points.push_back(point);
  }
  return points;
}

/// Least squares of second differences and of changes, under the linearised condition that the end
/// is met.
Curve fitted(const Curve& curve, const CurveEnd& end, double weight) {
  const auto nodes = static_cast<Eigen::Index>(curve.curvature.size());
  const Eigen::Index free = nodes - 1;  // curvatures of nodes 1, 2, ...; the last unknown: length
  Eigen::MatrixXd hessian = Eigen::MatrixXd::Identity(nodes, nodes);
  hessian(free, free) = kLengthPrice / std::pow(curve.spacing, 4);
  Eigen::MatrixXd second = Eigen::MatrixXd::Zero(std::max<Eigen::Index>(nodes - 2, 0), nodes);
  Eigen::VectorXd known = Eigen::VectorXd::Zero(second.rows());
  for (Eigen::Index i = 0; i < second.rows(); ++i) {
    if (i > 0) second(i, i - 1) = 1;
    second(i, i) = -2;
    second(i, i + 1) = 1;
  }
  if (second.rows() > 0) known[0] = curve.curvature.front();
  hessian += weight * second.transpose() * second;

  Curve best = curve;
  const Eigen::Map<const Eigen::VectorXd> first(curve.curvature.data() + 1, free);
  for (int step = 0; step < kNewtonSteps; ++step) {
    const Eigen::MatrixXd derivatives = end_derivatives(best, end);
    const Eigen::VectorXd lack = missing(end_of(best), end);
    Eigen::VectorXd now(nodes), wanted(nodes);
    now << Eigen::Map<const Eigen::VectorXd>(best.curvature.data() + 1, free), best.length;
    wanted << first, curve.length;
    Eigen::VectorXd pull = wanted;
    pull[free] *= hessian(free, free);
    pull -= weight * second.transpose() * known;
    const Eigen::Index conditions = derivatives.rows();
    Eigen::MatrixXd system = Eigen::MatrixXd::Zero(nodes + conditions, nodes + conditions);
    system.topLeftCorner(nodes, nodes) = hessian;
    system.topRightCorner(nodes, conditions) = derivatives.transpose();
    system.bottomLeftCorner(conditions, nodes) = derivatives;
    Eigen::VectorXd right(nodes + conditions);
    right << pull, lack + derivatives * now;
    const Eigen::VectorXd solved = system.partialPivLu().solve(right);
    if (!solved.allFinite()) break;
    Eigen::Map<Eigen::VectorXd>(best.curvature.data() + 1, free) = solved.head(free);
    best.length = std::clamp(solved[free], 0.5 * curve.length, 2 * curve.length);
  }
  return best;
}

}  // namespace blindcorner
