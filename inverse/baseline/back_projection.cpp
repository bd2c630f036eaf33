// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/baseline/back_projection.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <string>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/validate.h"
#include "inverse/baseline/object_signal.h"

namespace blindcorner {
namespace {

/// Change of the log likelihood along an axis below which the axis is left open: what a Gaussian
/// falls by within one standard deviation.
constexpr double kTells = 0.5;
/// Most moves from voxel to voxel at one distance of voxels: enough to cross the first grid, which
/// has by default at most about 20 voxels along each of three axes of equal range.
constexpr int kMaxMoves = 20;
/// Rounds of parabolas, each at half the step of the one before: the last step is an eighth of the
/// climb's, a 16th of the pulse or less.
constexpr int kRefinements = 3;

/// The score of one capture as a function of the pose.
class Score {
 public:
  Score(const SignalScene& shared, const RelayPaths& paths, std::vector<ZoneSignal> signals)
      : shared_(shared),
        paths_(paths),
        signals_(std::move(signals)),
        each_zone_(shared.scene().linear.amplitude == LinearMode::per_zone) {}

  /// Gain in log likelihood when a point scatters at this pose, against no such point. `blur` (m,
  /// standard deviation of the path) widens the pulses, so that the voxels of a coarse grid do not
  /// miss any light.
  double operator()(const PoseVector& pose, double blur = 0) const {
    const Scene& scene = shared_.scene();
    paths_.pulses(scattering_point(scene, pose), true, pulses_);
    double total = 0, signal_sum = 0, pulse_sum = 0;
    for (std::size_t z = 0; z < signals_.size(); ++z) {
      if (!signals_[z].used || pulses_[z].weight <= 0) continue;
      double of_signal = 0, of_pulse = 0;
      const int zone = static_cast<int>(z);
      shared_.correlate(zone, signals_[z], shared_.position(zone, pulses_[z].path),
                        (pulses_[z].variance + blur * blur) / (kSpeedOfLight * kSpeedOfLight),
                        of_signal, of_pulse);
      const double weight = scene.sensor.zones[z].gain * pulses_[z].weight;
      signal_sum += weight * of_signal;
      pulse_sum += weight * weight * of_pulse;
      if (each_zone_) total += gain(of_signal, of_pulse);
    }
    return each_zone_ ? total : gain(signal_sum, pulse_sum);
  }

 private:
  static double gain(double signal_sum, double pulse_sum) {
    if (signal_sum <= 0 || pulse_sum <= 0) return 0;
    return 0.5 * signal_sum * signal_sum / pulse_sum;
  }

  const SignalScene& shared_;
  const RelayPaths& paths_;
  std::vector<ZoneSignal> signals_;
  bool each_zone_;  ///< the object's brightness is free in each zone
  mutable std::vector<PointPulse> pulses_;
};

void set(PoseVector& pose, const PositionGrid& grid, const std::vector<double>& point) {
  for (std::size_t a = 0; a < point.size(); ++a) {
    pose[static_cast<Eigen::Index>(grid.unknowns[a])] = point[a];
  }
}

/// Change of the score along an axis: for each value of the axis, the best score over the other
/// axes counts.
double change_along(const PositionGrid& grid, const std::vector<double>& scores, std::size_t axis) {
  std::size_t stride = 1;
  for (std::size_t a = 0; a < axis; ++a) stride *= static_cast<std::size_t>(grid.counts[a]);
  const auto count = static_cast<std::size_t>(grid.counts[axis]);
  std::vector<double> best(count, 0);
  for (std::size_t i = 0; i < scores.size(); ++i) {
    double& value = best[i / stride % count];
    value = std::max(value, scores[i]);
  }
  const auto [low, high] = std::ranges::minmax(best);
  return high - low;
}

/// Climbs to the best neighbour of the pose, one step away along each axis, until none is better.
void climb(const Scene& scene, const Score& score, const std::vector<std::size_t>& axes,
           const std::vector<double>& steps, double blur, PoseVector& pose) {
  int neighbours = 1;
  for (std::size_t a = 0; a < axes.size(); ++a) neighbours *= 3;
  double best = score(pose, blur);
  for (int moves = 0; moves < kMaxMoves; ++moves) {
    PoseVector best_pose = pose;
    for (int n = 0, code = 0; n < neighbours; code = ++n) {
      PoseVector moved = pose;
      for (std::size_t a = 0; a < axes.size(); ++a, code /= 3) {
        const Unknown& unknown = scene.unknowns[axes[a]];
        double& value = moved[static_cast<Eigen::Index>(axes[a])];
        value = std::clamp(value + (code % 3 - 1) * steps[a], unknown.lower, unknown.upper);
      }
      const double value = score(moved, blur);
      if (value > best) best = value, best_pose = moved;
    }
    if (best_pose == pose) return;
    pose = best_pose;
  }
}

/// Moves the pose to the top of the paraboloid through its score and the scores of its neighbours,
/// one step away along each axis and each diagonal. The pose stays if there is no top or the score
/// there is not higher.
void refine(const Scene& scene, const Score& score, const std::vector<std::size_t>& axes,
            const std::vector<double>& steps, PoseVector& pose) {
  const auto n = static_cast<Eigen::Index>(axes.size());
  const auto at = [&](Eigen::Index a, double along, Eigen::Index b, double across) {
    PoseVector moved = pose;
    moved[static_cast<Eigen::Index>(axes[static_cast<std::size_t>(a)])] +=
        along * steps[static_cast<std::size_t>(a)];
    moved[static_cast<Eigen::Index>(axes[static_cast<std::size_t>(b)])] +=
        across * steps[static_cast<std::size_t>(b)];
    return score(moved);
  };
  const double middle = score(pose);
  Eigen::VectorXd slope(n);  // per step
  Eigen::MatrixXd bend(n, n);
  for (Eigen::Index a = 0; a < n; ++a) {
    const double above = at(a, 1, a, 0), below = at(a, -1, a, 0);
    slope[a] = 0.5 * (above - below);
    bend(a, a) = above - 2 * middle + below;
    for (Eigen::Index b = 0; b < a; ++b) {
      bend(a, b) = bend(b, a) =
          0.25 * (at(a, 1, b, 1) - at(a, 1, b, -1) - at(a, -1, b, 1) + at(a, -1, b, -1));
    }
  }
  const Eigen::LLT<Eigen::MatrixXd> down(-bend);
  if (down.info() != Eigen::Success) return;
  const Eigen::VectorXd move = down.solve(slope).cwiseMax(-1).cwiseMin(1);
  PoseVector moved = pose;
  for (Eigen::Index a = 0; a < n; ++a) {
    const auto i = axes[static_cast<std::size_t>(a)];
    double& value = moved[static_cast<Eigen::Index>(i)];
    value += move[a] * steps[static_cast<std::size_t>(a)];
    value = std::clamp(value, scene.unknowns[i].lower, scene.unknowns[i].upper);
  }
  if (score(moved) > middle) pose = moved;
}

}  // namespace

void BackProjectionOptions::validate() const {
  if (!(spacing > 0 && std::isfinite(spacing))) {
    throw Error("spacing", "found " + std::to_string(spacing) + ", accepted: > 0");
  }
  if (max_voxels < 8) {
    throw Error("max_voxels", "found " + std::to_string(max_voxels) + ", accepted: >= 8");
  }
}

struct BackProjection::Impl {
  SignalScene shared;
  PositionGrid grid;
  double spacing;  ///< m, of the finest voxels

  /// Width (m) that a pulse needs so that the voxels of a grid miss no light: a move by one step
  /// changes a path by up to twice the step, uniformly.
  double blur(const std::vector<double>& steps) const {
    const double widest = *std::ranges::max_element(steps);
    return widest > spacing ? 2 * widest / std::sqrt(12.0) : 0.0;
  }
};

BackProjection::BackProjection(const Scene& scene, const BackProjectionOptions& options) {
  options.validate();
  validate(scene);
  impl_ = std::make_unique<Impl>(Impl{SignalScene(scene), {}, 0});
  impl_->spacing = options.spacing * impl_->shared.pulse_path();
  impl_->grid = position_grid(scene, impl_->spacing, options.max_voxels);
}
BackProjection::~BackProjection() = default;
BackProjection::BackProjection(BackProjection&&) noexcept = default;
BackProjection& BackProjection::operator=(BackProjection&&) noexcept = default;

PoseVector BackProjection::predict(const Capture& capture) const {
  const Scene& scene = impl_->shared.scene();
  const PositionGrid& grid = impl_->grid;
  const RelayPaths paths(scene, sensor_placement(scene, &capture));
  const Score score(impl_->shared, paths, impl_->shared.extract(capture, paths));
  const PoseVector middle = middle_of_prior(scene);
  PoseVector pose = middle;
  std::vector<double> scores(grid.size());
  for (std::size_t i = 0; i < scores.size(); ++i) {
    set(pose, grid, grid.at(i));
    scores[i] = score(pose, impl_->blur(grid.step));
  }
  const auto strongest = std::ranges::max_element(scores);
  if (*strongest <= 0) return middle;
  set(pose, grid, grid.at(static_cast<std::size_t>(strongest - scores.begin())));
  std::vector<std::size_t> told;
  std::vector<double> steps;
  for (std::size_t a = 0; a < grid.unknowns.size(); ++a) {
    const auto i = static_cast<Eigen::Index>(grid.unknowns[a]);
    if (change_along(grid, scores, a) < kTells) {
      pose[i] = middle[i];
    } else {
      told.push_back(grid.unknowns[a]);
      steps.push_back(grid.step[a]);
    }
  }
  if (told.empty()) return pose;
  for (bool finest = false; !finest;) {
    finest = *std::ranges::max_element(steps) <= impl_->spacing;
    climb(scene, score, told, steps, impl_->blur(steps), pose);
    for (double& step : steps) step *= 0.5;
  }
  for (int round = 0; round < kRefinements; ++round) {
    refine(scene, score, told, steps, pose);
    for (double& step : steps) step *= 0.5;
  }
  return pose;
}

}  // namespace blindcorner
