// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/ridge.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "inverse/posterior/prior_moments.h"

namespace blindcorner {
namespace {

/// Fall of the log target below which nothing is drawn: three standard deviations of a Gaussian.
constexpr double kRidgeFall = 4.5;
/// Fall at which a ridge ends. Between two places of an oblique floor's plate that are as likely
/// (10,000 photons) it falls by 5 to 8 and rises again.
constexpr double kRidgeEnd = 10;
/// Axes that are followed: at least this long in units of the longest. Shorter ones leave the
/// sampler's Student t less to miss.
constexpr double kLongAxis = 0.5;
constexpr std::size_t kMaxAxes = 2;
/// Where the fall across the ridge is asked, in standard deviations of the peak: half of one tells
/// a slope from the curvature that is taken for the peak's.
constexpr double kAcross = 0.5;
/// Farthest that one correction goes along an axis, standard deviations of the peak; corrections at
/// a place; and one that is so short that the next step along the ridge may be twice as long.
constexpr double kFarAcross = 2;
constexpr int kMaxCorrections = 3;
constexpr int kHalvings = 3;
constexpr double kStraight = 0.4;
/// Steps along the ridge, standard deviations of the peak.
constexpr double kFirstStep = 1, kShortestStep = 0.2, kLongestStep = 2;
/// Steps to one side. A ridge whose end is not reached by then is drawn from by what samples learn.
constexpr int kMaxSteps = 10;

/// Principal axes of a peak, one standard deviation long, as columns, longest first: principal in
/// units of the prior's widths, so that metres and radians compare.
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
      const auto place = corrected(at_ + length * direction_);
      const bool ended = place && place->target < top_ - kRidgeEnd;
      if (ended && fallen) break;
      if (!place || ended) {
        length /= 2;
        continue;
      }
      const PoseVector step = place->pose - at_;
      fallen = place->target < top_ - kRidgeFall;
      if (!fallen) {
        components.push_back(component(place->pose, step, place->target));
      }
      direction_ = step / length;
      at_ = place->pose;
      if (place->moved < kStraight) length = std::min(2 * length, kLongestStep);
    }
    return components;
  }

 private:
  struct Place {
    PoseVector pose;
    double target;
    double moved;  ///< across the ridge, standard deviations, along the axis of the largest
  };

  /// The highest place across the ridge from a guess: quasi-Newton steps (Broyden, Fletcher,
  /// Goldfarb, Shanno), whose curvature is the peak's at first and is kept along the ridge.
  std::optional<Place> corrected(const PoseVector& guess) {
    Place place{guess, target_(guess), 0};
    if (!std::isfinite(place.target)) return std::nullopt;
    Eigen::VectorXd slope = slope_across(place);
    for (int k = 0; k < kMaxCorrections; ++k) {
      Eigen::VectorXd by = inverse_ * slope;
      by *= std::min(1.0, kFarAcross / std::max(by.norm(), 1e-12));
      if (by.norm() < kStraight) break;
      std::optional<Place> next;
      for (int halving = 0; halving < kHalvings && !next; ++halving, by /= 2) {
        const PoseVector pose = place.pose + across_axes_ * by;
        const double there = target_(pose);
        if (there > place.target) next = Place{pose, there, place.moved + by.norm()};
      }
      if (!next) break;
      by *= 2;  // halved once too often
      place = std::move(*next);
      const Eigen::VectorXd now = slope_across(place);
      learn(by, slope - now);
      slope = now;
    }
    return place;
  }

  /// Slopes of the log target across the ridge, per standard deviation of the peak.
  Eigen::VectorXd slope_across(const Place& place) const {
    Eigen::VectorXd slope = Eigen::VectorXd::Zero(across_axes_.cols());
    for (Eigen::Index i = 0; i < slope.size(); ++i) {
      double probe = kAcross;
      double there = target_(place.pose + probe * across_axes_.col(i));
      if (!std::isfinite(there)) {
        probe = -kAcross;
        there = target_(place.pose + probe * across_axes_.col(i));
      }
      if (std::isfinite(there)) slope[i] = (there - place.target) / probe + probe / 2;
    }
    return slope;
  }

  /// `fall` is how the slope fell along `step`.
  void learn(const Eigen::VectorXd& step, const Eigen::VectorXd& fall) {
    const double curvature = step.dot(fall);
    if (!(curvature > 1e-2 * step.squaredNorm())) return;  // not a maximum there
    const Eigen::Index m = step.size();
    const Eigen::MatrixXd left =
        Eigen::MatrixXd::Identity(m, m) - step * fall.transpose() / curvature;
    inverse_ = left * inverse_ * left.transpose() + step * step.transpose() / curvature;
  }

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
  tbb::parallel_for(std::size_t{0}, walks, [&](std::size_t i) {
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
