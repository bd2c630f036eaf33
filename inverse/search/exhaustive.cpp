// SPDX-License-Identifier: Apache-2.0
#include "inverse/search/exhaustive.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "blindcorner/forward/error.h"
#include "inverse/likelihood/background_error.h"
#include "inverse/posterior/mode_merging.h"
#include "inverse/posterior/posterior.h"
#include "inverse/search/compiled_scene.h"

namespace blindcorner {
namespace {

/// Accuracy of a grid point's log posterior. The point's weight is then right to a thousandth.
/// Refined poses are exact.
constexpr double kAccuracy = 1e-3;
/// Optima this far below the best one, in log posterior, do not matter. As in the fit
/// (FitOptions::negligible_log_posterior).
constexpr double kNegligible = 12;

}  // namespace

void ExhaustiveOptions::validate() const {
  if (!(density > 0)) throw Error("ExhaustiveOptions.density", "accepted: above 0");
  if (max_poses < 1) throw Error("ExhaustiveOptions.max_poses", "accepted: at least 1");
  if (refined < 1) throw Error("ExhaustiveOptions.refined", "accepted: at least 1");
}

struct ExhaustiveSearch::Impl {
  ExhaustiveOptions options;
  std::unique_ptr<CompiledScene> compiled;

  Observation observe_one(const Capture& capture) const {
    return blindcorner::observe(*compiled, {&capture, 1});
  }
};

ExhaustiveSearch::ExhaustiveSearch(const Scene& scene, const ExhaustiveOptions& options)
    : impl_(std::make_unique<Impl>()) {
  options.validate();
  impl_->options = options;
  GridOptions grid;
  grid.density = options.density;
  grid.max_poses = options.max_poses;
  grid.widen = false;
  grid.spline = false;
  grid.sharp = true;
  FitOptions fit;
  fit.model_tolerance = options.model_tolerance;
  impl_->compiled = compile(scene, {sensor_placement(scene)}, fit, grid);
}

ExhaustiveSearch::~ExhaustiveSearch() = default;
ExhaustiveSearch::ExhaustiveSearch(ExhaustiveSearch&&) noexcept = default;

int ExhaustiveSearch::poses() const { return static_cast<int>(impl_->compiled->poses.size()); }

double ExhaustiveSearch::log_posterior(const Capture& capture, const PoseVector& pose) const {
  const Observation observation = impl_->observe_one(capture);
  const PoseObjective objective(*impl_->compiled, observation);
  LinearSolution linear;
  return objective.evaluate(impl_->compiled->models(), pose, linear, false).log_posterior;
}

ExhaustiveSearch::Optimum ExhaustiveSearch::descend(const Capture& capture,
                                                    const PoseVector& start) const {
  const Observation observation = impl_->observe_one(capture);
  const PoseObjective objective(*impl_->compiled, observation);
  const Refined refined = polish(objective, start);
  return {refined.value.log_posterior, refined.pose};
}

ExhaustiveResult ExhaustiveSearch::search(const Capture& capture,
                                          std::vector<PoseVector> starts) const {
  const CompiledScene& compiled = *impl_->compiled;
  const Observation observation = impl_->observe_one(capture);
  const PoseObjective objective(compiled, observation);

  // Evaluate every pose of the grid. Each starts from the linear unknowns of the one before.
  const int count = static_cast<int>(compiled.poses.size());
  std::vector<PoseValue> values(compiled.poses.size());
  std::vector<int> order(compiled.poses.size());
  LinearSolution linear;
  double top = -std::numeric_limits<double>::infinity();
  for (int i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    values[k] = objective.evaluate_template(i, linear, i > 0 && linear.converged, kAccuracy);
    order[k] = i;
    top = std::max(top, values[k].log_integrand);
  }

  // Choose the best grid points that are no neighbours.
  std::sort(order.begin(), order.end(), [&](int a, int b) {
    const double x = values[static_cast<std::size_t>(a)].log_posterior;
    const double y = values[static_cast<std::size_t>(b)].log_posterior;
    return x != y ? x > y : a < b;
  });
  std::vector<Start> chosen;
  const double best_grid = values[static_cast<std::size_t>(order.front())].log_posterior;
  for (const int i : order) {
    if (static_cast<int>(chosen.size()) >= impl_->options.refined) break;
    if (values[static_cast<std::size_t>(i)].log_posterior < best_grid - 15) break;
    const PoseVector& pose = compiled.poses[static_cast<std::size_t>(i)];
    const bool close = std::any_of(chosen.begin(), chosen.end(), [&](const Start& other) {
      return within_spacings(compiled, other.pose, pose, kNextOnGrid);
    });
    if (!close) chosen.push_back({pose});
  }
  // Descend from them on the cheap model first, as the fit does. The given starts skip this.
  const std::vector<Refined> basins =
      merge(compiled, approach_all(objective, chosen), 1.5 * kNegligible);
  for (const Refined& basin : basins) starts.push_back(basin.pose);
  const std::vector<Refined> optima = find_optima(objective, starts, kNegligible);

  ExhaustiveResult result;
  result.log_posterior = optima.front().value.log_posterior;
  result.pose = optima.front().pose;

  // Share the posterior's mass on the grid among the modes: each point belongs to the mode that is
  // nearest in that mode's own standard deviations.
  PosteriorOptions shape;
  shape.samples = 0;
  PoseMixture mixture = posterior(objective, optima, nullptr, nullptr, shape).mixture;
  std::vector<Eigen::MatrixXd> precision;
  for (const PoseMode& mode : mixture.modes) {
    precision.push_back(mode.covariance.inverse());
  }
  struct Mass {
    double weight = 0;
    PoseVector first;
    Eigen::MatrixXd second;
  };
  const auto n = static_cast<Eigen::Index>(compiled.unknown_count());
  std::vector<Mass> masses(mixture.modes.size(),
                           {0.0, PoseVector::Zero(n), Eigen::MatrixXd::Zero(n, n)});
  for (int i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double weight = std::exp(values[k].log_integrand - top);
    if (weight < 1e-12) continue;  // all such points: less than 1e-6 of the best one
    double nearest = std::numeric_limits<double>::infinity();
    std::size_t own = 0;
    for (std::size_t j = 0; j < mixture.modes.size(); ++j) {
      const PoseVector d =
          pose_difference(compiled.scene, mixture.modes[j].optimum, compiled.poses[k]);
      const double distance = d.dot(precision[j] * d);
      if (distance < nearest) {
        nearest = distance;
        own = j;
      }
    }
    const PoseVector d =
        pose_difference(compiled.scene, mixture.modes[own].optimum, compiled.poses[k]);
    masses[own].weight += weight;
    masses[own].first += weight * d;
    masses[own].second += weight * d * d.transpose();
  }
  // Optima with no valley between them are one mode, as in the fit.
  std::vector<const Refined*> tops;
  for (const PoseMode& mode : mixture.modes) {
    tops.push_back(&*std::find_if(optima.begin(), optima.end(), [&](const Refined& optimum) {
      return optimum.pose == mode.optimum;
    }));
  }
  const std::vector<std::size_t> head = connect(objective, tops, 1.0);
  std::size_t heaviest = 0;
  double total = 0;
  for (const Mass& mass : masses) total += mass.weight;
  for (std::size_t j = 0; j < masses.size(); ++j) {
    if (head[j] == j) continue;
    // Add the moments about the other optimum.
    Mass& to = masses[head[j]];
    const PoseVector d =
        pose_difference(compiled.scene, mixture.modes[head[j]].optimum, mixture.modes[j].optimum);
    to.weight += masses[j].weight;
    to.first += masses[j].first + masses[j].weight * d;
    to.second += masses[j].second + masses[j].first * d.transpose() +
                 d * masses[j].first.transpose() + masses[j].weight * d * d.transpose();
    masses[j].weight = 0;
  }
  for (std::size_t j = 0; j < masses.size(); ++j) {
    if (masses[j].weight > masses[heaviest].weight) heaviest = j;
  }
  result.heaviest = mixture.modes[heaviest];
  const Mass& mass = masses[heaviest];
  if (mass.weight > 0) {
    result.heaviest.weight = mass.weight / total;
    // Sums over a grid are good to a per cent while the step is below twice the width (here below
    // 1.7 times). Narrower modes are left to Laplace's approximation.
    const Eigen::VectorXd width = precision[heaviest].diagonal().array().rsqrt();
    if ((width.array() > 0.6 * compiled.spacing.array()).all()) {
      const PoseVector shift = mass.first / mass.weight;
      result.heaviest.pose = result.heaviest.optimum + shift;
      wrap_pose(compiled.scene, result.heaviest.pose);
      result.heaviest.covariance = mass.second / mass.weight - shift * shift.transpose();
    }
  }
  return result;
}

}  // namespace blindcorner
