// SPDX-License-Identifier: Apache-2.0
#include "inverse/search/derivative_study.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace blindcorner {
namespace {

using Eigen::VectorXd;

VectorXd central_difference(const ForwardModel& model, const PoseVector& pose, Eigen::Index unknown,
                            double step) {
  PoseVector before = pose;
  PoseVector after = pose;
  before[unknown] -= step;
  after[unknown] += step;
  const HistogramCube low = model.three_bounce(before);
  const HistogramCube high = model.three_bounce(after);
  const auto size = static_cast<Eigen::Index>(low.values.size());
  return (Eigen::Map<const VectorXd>(high.values.data(), size) -
          Eigen::Map<const VectorXd>(low.values.data(), size)) /
         (2 * step);
}

/// Best entry of Ridders' tableau and how far it is from its neighbours.
std::pair<VectorXd, double> extrapolate(const ForwardModel& model, const PoseVector& pose,
                                        Eigen::Index unknown, double default_step) {
  // Ridders' method (Adv. Eng. Software 4, 1982), by judgement with steps from four times the
  // default down to a third of it (4 over 1.5^6), so that the best one is not at an end.
  constexpr int kRows = 7;
  constexpr double kRatio = 1.5;
  constexpr double kFirst = 4.0;
  double step = kFirst * default_step;
  std::vector<VectorXd> row{central_difference(model, pose, unknown, step)};
  std::pair<VectorXd, double> best{row.front(), std::numeric_limits<double>::infinity()};
  for (int i = 1; i < kRows; ++i) {
    step /= kRatio;
    std::vector<VectorXd> next{central_difference(model, pose, unknown, step)};
    double factor = 1;
    for (std::size_t j = 1; j <= static_cast<std::size_t>(i); ++j) {
      factor *= kRatio * kRatio;
      next.push_back((factor * next[j - 1] - row[j - 1]) / (factor - 1));
      const double change = std::max((next[j] - next[j - 1]).norm(), (next[j] - row[j - 1]).norm());
      if (change < best.second) best = {next[j], change};
    }
    row = std::move(next);
  }
  return best;
}

}  // namespace

DerivativeErrors derivative_errors(const ForwardModel& model, const PoseVector& pose,
                                   Eigen::Index unknown, const std::vector<double>& steps,
                                   double default_step) {
  const auto [truth, change] = extrapolate(model, pose, unknown, default_step);
  const double norm = truth.norm() > 0 ? truth.norm() : 1.0;
  DerivativeErrors result;
  result.resolution = change / norm;
  const VectorXd& exact = truth;
  const auto error = [&](double step) {
    return (central_difference(model, pose, unknown, step) - exact).norm() / norm;
  };
  result.steps = steps;
  for (const double step : steps) result.errors.push_back(error(step));
  result.at_default = error(default_step);
  return result;
}

}  // namespace blindcorner
