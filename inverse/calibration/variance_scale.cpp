// SPDX-License-Identifier: Apache-2.0
#include "inverse/calibration/variance_scale.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "blindcorner/inverse/fit.h"
#include "forward/support/parallel.h"

namespace blindcorner {
namespace {

/// Most captures that are fitted: the mean of that many squared errors is known to about a tenth.
constexpr std::size_t kMaxCaptures = 96;
/// Larger normalised errors count as this: one disturbed capture must not set the scale. With three
/// unknowns, one in two thousand is larger (chi-square of 18).
constexpr double kMaxError = 6.0;

/// Search for the factor by secants, by judgement. It starts at the error itself, at most at 3, and
/// fits all captures at most three times more. It ends when the error is within 3 % of one (the
/// mean error is known to a tenth). Where the error hardly falls, the factor grows by 1.3. The
/// factor never exceeds kMaxError, beyond which no error counts.
constexpr double kMaxStart = 3.0;
constexpr int kMaxSecants = 3;
constexpr double kCloseEnough = 0.03;
constexpr double kFlat = -0.05;
constexpr double kOnwards = 1.3;

/// Mean squared normalised error of fits to the calibration's own captures.
double normalised_error(const Scene& scene, const CalibrationProblem& problem,
                        const std::vector<double>& keep) {
  std::vector<std::size_t> chosen;
  for (std::size_t c = 0; c < keep.size(); ++c) {
    if (keep[c] > 0 && problem.pose(c)) chosen.push_back(c);
  }
  const std::size_t stride = (chosen.size() + kMaxCaptures - 1) / kMaxCaptures;
  FitOptions options;
  options.empty_captures = 0;
  const Fitter fitter(scene, options);
  std::vector<double> errors(chosen.size(), 0.0);
  parallel_for(std::size_t{0}, chosen.size(), [&](std::size_t i) {
    if (i % stride != 0) return;
    const FitResult result = fitter.fit(problem.capture(chosen[i]));
    const PoseVector error = pose_error(scene, result.posterior.mean, *problem.pose(chosen[i]));
    errors[i] = std::min(error.dot(result.posterior.covariance.ldlt().solve(error)) /
                             static_cast<double>(error.size()),
                         kMaxError);
  });
  const double count = std::ceil(static_cast<double>(chosen.size()) / static_cast<double>(stride));
  return std::accumulate(errors.begin(), errors.end(), 0.0) / count;
}

}  // namespace

void scale_variance(Scene& scene, double factor) {
  if (const auto line = scene.sensor.noise.stated_line()) {
    scene.sensor.noise.state_line({line->floor * factor, line->per_count * factor});
    for (Zone& zone : scene.sensor.zones) {
      if (zone.variance_floor > 0) zone.variance_floor *= factor;
    }
  } else {
    scene.sensor.dispersion *= factor;
  }
  for (NormalPrior& prior : scene.linear.ambient_prior) prior.sigma *= std::sqrt(factor);
}

double find_variance_scale(const Scene& scene, const CalibrationProblem& problem,
                           const std::vector<double>& keep) {
  double low = 1;
  double low_error = normalised_error(scene, problem, keep);
  if (low_error <= 1) return 1;
  double high = std::min(low_error, kMaxStart);
  for (int i = 0; i < kMaxSecants; ++i) {
    Scene scaled = scene;
    scale_variance(scaled, high);
    const double error = normalised_error(scaled, problem, keep);
    if (std::abs(std::log(error)) < kCloseEnough) return high;
    const double slope = (std::log(error) - std::log(low_error)) / (std::log(high) - std::log(low));
    const double next = slope < kFlat ? high * std::exp(-std::log(error) / slope) : kOnwards * high;
    low = high;
    low_error = error;
    high = std::clamp(next, 1.0, kMaxError);
  }
  return high;
}

}  // namespace blindcorner
