// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/ridge.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "bundled.h"

namespace blindcorner {
namespace {

constexpr double kAlong = 0.05;   // standard deviation along the ridge, m of x
constexpr double kThin = 0.002;   // across it, m of y
constexpr double kTurned = 0.05;  // rad of yaw

/// A peak in the middle of the search region.
Peak peak_of(const Scene& scene) {
  Peak peak;
  peak.center.resize(3);
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Unknown& unknown = scene.unknowns[static_cast<std::size_t>(i)];
    peak.center[i] = 0.5 * (unknown.lower + unknown.upper);
  }
  peak.covariance = Eigen::Vector3d(kAlong * kAlong, kThin * kThin, kTurned * kTurned).asDiagonal();
  peak.root = peak.covariance.llt().matrixL();
  peak.log_det = 2 * peak.root.diagonal().array().log().sum();
  return peak;
}

/// Least squared distance of a pose from the peak and the components, in units of their covariance.
double distance2(const Scene& scene, const Peak& peak, const std::vector<Peak>& components,
                 const PoseVector& pose) {
  double least = mahalanobis2(scene, peak, pose);
  for (const Peak& component : components) {
    least = std::min(least, mahalanobis2(scene, component, pose));
  }
  return least;
}

/// Where a ridge with a constant curvature is: y moves by `bend` times the square of x.
struct BentRidge {
  PoseVector center;
  double bend;  ///< 1/m
  PoseVector at(double t) const {
    const double x = t * kAlong;
    return center + Eigen::Vector3d(x, bend * x * x, 0);
  }
  double log_target(const PoseVector& pose) const {
    const PoseVector d = pose - center;
    const double y = (d[1] - bend * d[0] * d[0]) / kThin;
    return -0.5 * (std::pow(d[0] / kAlong, 2) + y * y + std::pow(d[2] / kTurned, 2));
  }
};

// Two standard deviations along it a bent ridge is fifteen of the peak's away from the peak's
// axis: no Student t about the peak draws there.
TEST(Ridge, ComponentsFollowABend) {
  const Scene scene = bundled_scene("reference_floor_corner_black");
  const Peak peak = peak_of(scene);
  const BentRidge ridge{peak.center, 3};
  ASSERT_GT(mahalanobis2(scene, peak, ridge.at(2)), 15 * 15);
  const auto components =
      ridge_components(scene, peak, [&](const PoseVector& p) { return ridge.log_target(p); });
  for (double t = -2.5; t <= 2.5; t += 0.25) {
    EXPECT_LT(distance2(scene, peak, components, ridge.at(t)), 2 * 2) << "at " << t;
  }
}

// What is as likely as the peak beyond a valley of six units of log posterior is reached.
TEST(Ridge, ComponentsCrossAValley) {
  const Scene scene = bundled_scene("reference_floor_corner_black");
  const Peak peak = peak_of(scene);
  const PoseVector other = peak.center + Eigen::Vector3d(7 * kAlong, 0, 0);
  const auto log_target = [&](const PoseVector& pose) {
    const auto gaussian = [&](const PoseVector& center) {
      return -0.5 * Eigen::Vector3d(pose - center)
                        .cwiseQuotient(Eigen::Vector3d(kAlong, kThin, kTurned))
                        .squaredNorm();
    };
    return std::max(gaussian(peak.center), gaussian(other));
  };
  const auto components = ridge_components(scene, peak, log_target);
  EXPECT_LT(distance2(scene, peak, components, other), 1);
}

// A Gaussian needs no components far from its peak, and few evaluations tell.
TEST(Ridge, GaussianTakesFewEvaluations) {
  const Scene scene = bundled_scene("reference_floor_corner_black");
  const Peak peak = peak_of(scene);
  const BentRidge straight{peak.center, 0};
  std::atomic<int> asked = 0;
  const auto components = ridge_components(scene, peak, [&](const PoseVector& pose) {
    ++asked;
    return straight.log_target(pose);
  });
  // Two long axes (x and yaw, in units of their priors), two sides, three places, each with the
  // slopes of the two directions across.
  EXPECT_LE(asked, 2 * 2 * 3 * (1 + 2) + 1);
  for (const Peak& component : components) {
    EXPECT_LT(mahalanobis2(scene, peak, component.center), 9.1);
  }
}

// The prior's end is the ridge's.
TEST(Ridge, EndsWhereThePriorDoes) {
  const Scene scene = bundled_scene("reference_floor_corner_black");
  const Peak peak = peak_of(scene);
  const BentRidge straight{peak.center, 0};
  const double end = peak.center[0] + 1.2 * kAlong;
  const auto components = ridge_components(scene, peak, [&](const PoseVector& pose) {
    return pose[0] > end ? -std::numeric_limits<double>::infinity() : straight.log_target(pose);
  });
  for (const Peak& component : components) EXPECT_LE(component.center[0], end);
}

}  // namespace
}  // namespace blindcorner
