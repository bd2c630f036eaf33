// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/ridge.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "forward/support/parallel.h"
#include "inverse/posterior/prior_moments.h"

namespace blindcorner {
namespace {

/// Fall of the log target beyond which nothing is drawn: that of a Gaussian at three standard
/// deviations.
constexpr double kRidgeFall = 4.5;
/// Fall at which a ridge ends. Between two equally likely places of a plate over an oblique floor
/// (10,000 photons), the log target falls by 5 to 8 and rises again.
constexpr double kRidgeEnd = 10;
/// Least length of an axis that is followed, relative to the longest axis. Along shorter axes, the
/// sampler's Student t misses less. By judgement, as is the number of axes: each costs two walks.
constexpr double kLongAxis = 0.5;
constexpr std::size_t kMaxAxes = 2;
/// Most steps across the ridge at a place, by judgement. If the way across is shorter than
/// kStraight, in standard deviations, the next step along the ridge may be twice as long: climb()
/// takes no shorter step at first.
constexpr int kMaxCorrections = 3;
constexpr double kStraight = 0.4;
/// Steps along the ridge, in standard deviations of the peak. A component is as long as the step
/// that leads to it, so that neighbours overlap. By judgement: longer steps miss bends.
constexpr double kFirstStep = 1, kShortestStep = 0.2, kLongestStep = 2;
/// Most steps to one side, by judgement: they reach up to 20 standard deviations. Where a ridge
/// goes on, the sampler's learned components draw from the rest.
constexpr int kMaxSteps = 10;

/// Principal axes of a peak as columns, one standard deviation long, longest first. They are
/// principal in units of the prior's widths, so that metres and radians compare.
struct Axes {
  Eigen::MatrixXd columns;
  Eigen::VectorXd lengths;  ///< in units of the prior's widths
};

Axes principal_axes(const Scene& scene, const Peak& peak) {
  const Eigen::Index n = peak.center.size();
  Eigen::VectorXd unit(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    unit[i] = std::sqrt(prior_moments(scene, static_cast<std::size_t>(i)).variance);
  }
  const Eigen::MatrixXd scaled =
      unit.cwiseInverse().asDiagonal() * peak.covariance * unit.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  Axes axes;
  axes.lengths = eigen.eigenvalues().cwiseMax(0).cwiseSqrt().reverse();
  axes.columns = unit.asDiagonal() * eigen.eigenvectors().rowwise().reverse() *
                 Eigen::MatrixXd(axes.lengths.asDiagonal());
  return axes;
}

/// Follows one axis to one side.
class RidgeWalk {
 public:
  RidgeWalk(const Peak& peak, const Axes& axes, Eigen::Index along, double side,
            const LogTarget& target, double top)
      : target_(target), top_(top), at_(peak.center), direction_(side * axes.columns.col(along)) {
    const Eigen::VectorXd own = axes.columns.col(along);
    across_ = peak.covariance - own * own.transpose();
    const Eigen::Index n = axes.columns.cols();
    across_axes_.resize(n, n - 1);
    across_axes_ << axes.columns.leftCols(along), axes.columns.rightCols(n - 1 - along);
    inverse_.setIdentity(n - 1, n - 1);
  }

  std::vector<Peak> walk() {
    std::vector<Peak> components;
    double length = kFirstStep;
    bool fallen = false;  // so far that nothing is drawn there
    for (int i = 0; i < kMaxSteps && length >= kShortestStep; ++i) {
      Climbed place{at_ + length * direction_, 0, 0};
      place.target = target_(place.pose);
      const bool inside = std::isfinite(place.target);
      if (inside) {
        place = climb(std::move(place), across_axes_, target_, kMaxCorrections, inverse_);
      }
      const bool ended = inside && place.target < top_ - kRidgeEnd;
      if (ended && fallen) break;
      if (!inside || ended) {
        length /= 2;
        continue;
      }
      const PoseVector step = place.pose - at_;
      fallen = place.target < top_ - kRidgeFall;
      if (!fallen) {
        components.push_back(component(place.pose, step, place.target));
      }
      direction_ = step / length;
      at_ = place.pose;
      if (place.moved < kStraight) length = std::min(2 * length, kLongestStep);
    }
    return components;
  }

 private:
  Peak component(const PoseVector& center, const PoseVector& step, double target) const {
    Peak peak;
    peak.center = center;
    peak.covariance = across_ + step * step.transpose();
    peak.root = peak.covariance.llt().matrixL();
    peak.log_det = 2 * peak.root.diagonal().array().log().sum();
    peak.log_evidence =
        target + 0.5 * static_cast<double>(center.size()) * std::log(2 * kPi) + 0.5 * peak.log_det;
    return peak;
  }

  const LogTarget& target_;
  double top_;
  PoseVector at_;
  PoseVector direction_;
  Eigen::MatrixXd across_;       ///< covariance without the axis that is followed
  Eigen::MatrixXd across_axes_;  ///< [n, n - 1] the other axes
  Eigen::MatrixXd inverse_;      ///< of the curvature across, in units of these axes
};

}  // namespace

std::vector<Peak> ridge_components(const Scene& scene, const Peak& peak, const LogTarget& target) {
  const double top = target(peak.center);
  const Axes axes = principal_axes(scene, peak);
  std::size_t walks = 0;
  while (walks < 2 * kMaxAxes && static_cast<Eigen::Index>(walks / 2) < axes.lengths.size() &&
         axes.lengths[static_cast<Eigen::Index>(walks / 2)] >= kLongAxis * axes.lengths[0]) {
    walks += 2;
  }
  std::vector<std::vector<Peak>> found(walks);
  parallel_for(std::size_t{0}, walks, [&](std::size_t i) {
    const double side = i % 2 == 0 ? -1 : 1;
    RidgeWalk walk(peak, axes, static_cast<Eigen::Index>(i / 2), side, target, top);
    found[i] = walk.walk();
  });
  std::vector<Peak> components;
  for (std::vector<Peak>& one : found) {
    for (Peak& component : one) {
      wrap_pose(scene, component.center);
      if (std::isfinite(component.log_det)) components.push_back(std::move(component));
    }
  }
  return components;
}

}  // namespace blindcorner
