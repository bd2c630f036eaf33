// SPDX-License-Identifier: Apache-2.0
#include "inverse/search/climb.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace blindcorner {
namespace {

/// Distance over which slopes are measured, standard deviations. Over half of one, a slope can be
/// told from the curvature, which is taken to be the Gaussian's.
constexpr double kProbe = 0.5;
/// Longest step, and shortest step that is worth taking, standard deviations. A Gaussian has fallen
/// to 14 % at the longest and to 92 % at the shortest. By judgement.
constexpr double kFarthest = 2, kNearest = 0.4;
/// Most halvings of a step that goes down. They make the longest step shorter than kNearest.
constexpr int kHalvings = 3;
/// Least curvature along a step that updates the inverse curvature, in units of the Gaussian's. A
/// place where the target is ten times as wide is no maximum of its own. By judgement.
constexpr double kMinCurvature = 1e-2;

/// Slopes of the log target, per standard deviation.
Eigen::VectorXd slope_along(const Eigen::MatrixXd& directions, const LogTarget& target,
                            const Climbed& place) {
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(directions.cols());
  for (Eigen::Index i = 0; i < slope.size(); ++i) {
    double probe = kProbe;
    double there = target(place.pose + probe * directions.col(i));
    if (!std::isfinite(there)) {
      probe = -kProbe;
      there = target(place.pose + probe * directions.col(i));
    }
    if (std::isfinite(there)) slope[i] = (there - place.target) / probe + probe / 2;
  }
  return slope;
}

/// Updates the inverse curvature. `fall` is the decrease of the slope along `step`.
void learn(const Eigen::VectorXd& step, const Eigen::VectorXd& fall, Eigen::MatrixXd& inverse) {
  const double curvature = step.dot(fall);
  if (!(curvature > kMinCurvature * step.squaredNorm())) return;  // no maximum there
  const Eigen::Index m = step.size();
  const Eigen::MatrixXd left =
      Eigen::MatrixXd::Identity(m, m) - step * fall.transpose() / curvature;
  inverse = left * inverse * left.transpose() + step * step.transpose() / curvature;
}

}  // namespace

Climbed climb(Climbed from, const Eigen::MatrixXd& directions, const LogTarget& target, int steps,
              Eigen::MatrixXd& inverse) {
  Climbed place = std::move(from);
  Eigen::VectorXd slope = slope_along(directions, target, place);
  for (int k = 0; k < steps; ++k) {
    Eigen::VectorXd by = inverse * slope;
    by *= std::min(1.0, kFarthest / std::max(by.norm(), 1e-12));
    if (by.norm() < kNearest) break;
    std::optional<Climbed> next;
    for (int halving = 0; halving <= kHalvings && !next; ++halving) {
      if (halving > 0) by /= 2;
      PoseVector pose = place.pose + directions * by;
      const double there = target(pose);
      if (there > place.target) next = Climbed{std::move(pose), there, place.moved + by.norm()};
    }
    if (!next) break;
    place = std::move(*next);
    if (k + 1 == steps) break;
    const Eigen::VectorXd now = slope_along(directions, target, place);
    learn(by, slope - now, inverse);
    slope = now;
  }
  return place;
}

}  // namespace blindcorner
