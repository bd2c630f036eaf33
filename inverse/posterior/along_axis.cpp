// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/along_axis.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "blindcorner/forward/constants.h"

namespace blindcorner {

Eigen::MatrixXd principal_deviations(const Eigen::MatrixXd& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance);
  return eigen.eigenvectors() *
         Eigen::MatrixXd(eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal());
}

bool falls_like_gaussian(const FallRatios& ratios) {
  for (std::size_t k = 0; k < kAway.size(); ++k) {
    if (std::abs(kAway[k]) != kSigmaPoint) continue;
    if (!(ratios[k] >= 1 / kLaplaceFactor && ratios[k] <= kLaplaceFactor)) return false;
  }
  return true;
}

AlongAxis integrate_along(const FallRatios& ratios) {
  // At the ends, even a log posterior that falls only 1 / kLaplaceFactor as fast as a Gaussian's
  // leaves a density of 2e-6. The steps are far finer than the distances between the points of
  // kAway.
  constexpr double kEnd = 6, kStep = 0.05;
  const auto ratio = [&](double t) {
    const auto above = std::ranges::upper_bound(kAway, t);
    if (above == std::begin(kAway)) return ratios.front();
    if (above == std::end(kAway)) return ratios.back();
    const auto i = static_cast<std::size_t>(above - std::begin(kAway));
    const double part = (t - kAway[i - 1]) / (kAway[i] - kAway[i - 1]);
    return std::lerp(ratios[i - 1], ratios[i], part);
  };
  AlongAxis sums;
  for (double t = -kEnd; t <= kEnd; t += kStep) {
    const double density = std::exp(-0.5 * ratio(t) * t * t);
    sums.mass += density;
    sums.mean += density * t;
    sums.variance += density * t * t;
  }
  sums.mean /= sums.mass;
  sums.variance = sums.variance / sums.mass - sums.mean * sums.mean;
  sums.mass *= kStep / std::sqrt(2 * kPi);
  return sums;
}

}  // namespace blindcorner
