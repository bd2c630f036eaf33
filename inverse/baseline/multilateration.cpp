// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/baseline/multilateration.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/validate.h"
#include "blindcorner/inverse/baseline/back_projection.h"
#include "inverse/baseline/object_signal.h"
#include "inverse/posterior/prior_moments.h"

namespace blindcorner {
namespace {

/// Steps in which a time axis is searched, bins; a parabola goes on from the best one. A pulse is a
/// bin wide or wider, so that the best step is at most an eighth of a pulse away from its peak.
constexpr double kPeakStep = 0.25;
/// Error of a peak's place beside photon noise, bins: paths spread over spot and object. By
/// judgement; it bounds the weight of bright zones.
constexpr double kPeakError = 0.25;
/// Residuals beyond this many standard deviations lose influence: one in twenty of normal ones.
constexpr double kRobustFrom = 2;

/// Path length of a zone's peak.
struct PathLength {
  int zone = 0;
  double path = 0;   ///< m
  double sigma = 0;  ///< m
};

/// Standard deviations of photon noise by which a pulse at a place stands out.
double significance(const SignalScene& shared, int zone, const ZoneSignal& signal,
                    double position) {
  double of_signal = 0, of_pulse = 0;
  shared.correlate(zone, signal, position, signal.blur, of_signal, of_pulse);
  return of_pulse > 0 ? of_signal / std::sqrt(of_pulse) : 0;
}

std::optional<PathLength> strongest_peak(const SignalScene& shared, int zone,
                                         const ZoneSignal& signal, double threshold) {
  if (!signal.used) return std::nullopt;
  double best = 0, at = 0;
  for (double k = signal.earliest; k <= signal.latest + 0.5 * kPeakStep; k += kPeakStep) {
    const double value = significance(shared, zone, signal, k);
    if (value > best) best = value, at = k;
  }
  if (best < threshold) return std::nullopt;
  const double below = significance(shared, zone, signal, at - kPeakStep);
  const double above = significance(shared, zone, signal, at + kPeakStep);
  const double bend = below - 2 * best + above;
  if (bend < 0) {
    at += std::clamp(0.5 * kPeakStep * (below - above) / bend, -kPeakStep, kPeakStep);
  }
  const Sensor& sensor = shared.scene().sensor;
  const double time =
      at * sensor.bin_width - sensor.zones[static_cast<std::size_t>(zone)].time_zero;
  const double width = std::hypot(shared.pulse_path(), kSpeedOfLight * std::sqrt(signal.blur));
  const double sigma = std::hypot(width / best, kPeakError * sensor.bin_width * kSpeedOfLight);
  return PathLength{zone, kSpeedOfLight * time, sigma};
}

/// Difference of the path length by way of the point from the measured one, in standard deviations
/// of the latter.
struct PathResidual {
  const Scene& scene;
  const RelayPaths& paths;
  const std::vector<std::size_t>& unknowns;
  const PoseVector& known;
  PathLength measured;

  bool operator()(double const* const* parameters, double* residual) const {
    PoseVector pose = known;
    for (std::size_t a = 0; a < unknowns.size(); ++a) {
      pose[static_cast<Eigen::Index>(unknowns[a])] = parameters[0][a];
    }
    const PointPulse pulse = paths.pulse(measured.zone, scattering_point(scene, pose));
    *residual = (pulse.path - measured.path) / measured.sigma;
    return pulse.weight > 0;  // else the point is behind what the zone sees
  }
};

/// Difference of one unknown from its prior's mean, in the prior's standard deviations.
struct PriorResidual {
  std::size_t place;
  double mean, sigma;

  bool operator()(double const* const* parameters, double* residual) const {
    *residual = (parameters[0][place] - mean) / sigma;
    return true;
  }
};

/// The least value of the robust sum of squares from one start, and the point that has it.
struct Solution {
  double cost = std::numeric_limits<double>::infinity();
  std::vector<double> point;
};

template <class Residual>
ceres::CostFunction* numeric_cost(Residual residual, std::size_t parameters) {
  auto* cost = new ceres::DynamicNumericDiffCostFunction<Residual>(new Residual(residual));
  cost->AddParameterBlock(static_cast<int>(parameters));
  cost->SetNumResiduals(1);
  return cost;
}

/// The point with the least robust sum of squares that is found from one start.
Solution solve_from(const Scene& scene, const RelayPaths& paths, const PositionGrid& grid,
                    const std::vector<PathLength>& measured, const PoseVector& middle,
                    std::vector<double> start) {
  const std::size_t n = grid.unknowns.size();
  ceres::Problem problem;
  problem.AddParameterBlock(start.data(), static_cast<int>(n));
  for (const PathLength& m : measured) {
    problem.AddResidualBlock(numeric_cost(PathResidual{scene, paths, grid.unknowns, middle, m}, n),
                             new ceres::CauchyLoss(kRobustFrom), start.data());
  }
  for (std::size_t a = 0; a < n; ++a) {
    const std::size_t i = grid.unknowns[a];
    const PriorMoments prior = prior_moments(scene, i);
    problem.AddResidualBlock(
        numeric_cost(PriorResidual{a, prior.mean, std::sqrt(prior.variance)}, n), nullptr,
        start.data());
    problem.SetParameterLowerBound(start.data(), static_cast<int>(a), scene.unknowns[i].lower);
    problem.SetParameterUpperBound(start.data(), static_cast<int>(a), scene.unknowns[i].upper);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.logging_type = ceres::SILENT;
  options.max_num_iterations = 50;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) return {};
  return {summary.final_cost, start};
}

}  // namespace

void MultilaterationOptions::validate() const {
  if (!(threshold > 0 && std::isfinite(threshold))) {
    throw Error("threshold", "found " + std::to_string(threshold) + ", accepted: > 0");
  }
  if (starts_per_axis < 1 || starts_per_axis > 100) {
    throw Error("starts_per_axis",
                "found " + std::to_string(starts_per_axis) + ", accepted: 1 to 100");
  }
}

struct Multilateration::Impl {
  SignalScene shared;
  MultilaterationOptions options;
};

Multilateration::Multilateration(const Scene& scene, const MultilaterationOptions& options) {
  options.validate();
  validate(scene);
  impl_ = std::make_unique<Impl>(Impl{SignalScene(scene), options});
}
Multilateration::~Multilateration() = default;
Multilateration::Multilateration(Multilateration&&) noexcept = default;
Multilateration& Multilateration::operator=(Multilateration&&) noexcept = default;

PoseVector Multilateration::predict(const Capture& capture) const {
  const SignalScene& shared = impl_->shared;
  const Scene& scene = shared.scene();
  const RelayPaths paths(scene, sensor_placement(scene, &capture));
  const std::vector<ZoneSignal> signals = shared.extract(capture, paths);
  std::vector<PathLength> measured;
  for (std::size_t z = 0; z < signals.size(); ++z) {
    const auto peak =
        strongest_peak(shared, static_cast<int>(z), signals[z], impl_->options.threshold);
    if (peak) measured.push_back(*peak);
  }
  PoseVector pose = middle_of_prior(scene);
  if (measured.empty()) return pose;
  const PositionGrid grid = cell_centers(scene, impl_->options.starts_per_axis);
  Solution best;
  for (std::size_t i = 0; i < grid.size(); ++i) {
    Solution found = solve_from(scene, paths, grid, measured, pose, grid.at(i));
    if (found.cost < best.cost) best = std::move(found);
  }
  for (std::size_t a = 0; a < best.point.size(); ++a) {
    pose[static_cast<Eigen::Index>(grid.unknowns[a])] = best.point[a];
  }
  return pose;
}

}  // namespace blindcorner
