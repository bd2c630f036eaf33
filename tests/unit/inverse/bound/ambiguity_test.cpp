// SPDX-License-Identifier: Apache-2.0
#include "inverse/bound/ambiguity.h"

#include <gtest/gtest.h>

#include <cmath>

namespace blindcorner {
namespace {

/// Expected posterior variance of two equally probable points a distance of 1 apart whose photon
/// counts have these means: what the best of all methods reaches, summed over all counts.
double best_error(double mean, double other) {
  double error = 0;
  double a = std::exp(-mean), b = std::exp(-other);  // probabilities of n photons
  for (int n = 0; n < 400; ++n) {
    const double both = 0.5 * (a + b);
    if (both > 0) error += 0.25 * a * b / both;
    a *= mean / (n + 1);
    b *= other / (n + 1);
  }
  return error;
}

double bound_of_two(double mean, double other) {
  const Eigen::RowVector2d points(0, 1), roots(std::sqrt(mean), std::sqrt(other));
  return ambiguity_bound(points, Eigen::Vector2d(0.5, 0.5), roots)(0, 0);
}

TEST(AmbiguityBound, IsTheCovarianceOfPointsThatNothingTellsApart) {
  Eigen::MatrixXd points(2, 3);
  points << 0, 1, 4, 0, 2, -1;
  const Eigen::Vector3d weights(0.5, 0.25, 0.25);
  const Eigen::VectorXd mean = points * weights;
  const Eigen::MatrixXd off = points.colwise() - mean;
  const Eigen::MatrixXd covariance = off * weights.asDiagonal() * off.transpose();
  const Eigen::MatrixXd bound = ambiguity_bound(points, weights, Eigen::MatrixXd::Zero(5, 3));
  EXPECT_LT((bound - covariance).norm(), 1e-12);
}

TEST(AmbiguityBound, StaysBelowTheBestOfAllMethods) {
  for (const double mean : {0.1, 1.0, 10.0, 100.0}) {
    for (const double factor : {1.0, 1.1, 1.5, 3.0}) {
      const double best = best_error(mean, factor * mean);
      const double bound = bound_of_two(mean, factor * mean);
      EXPECT_LE(bound, best * (1 + 1e-9)) << mean << " " << factor;
      EXPECT_GE(bound, best * best) << "and says something: " << mean << " " << factor;
    }
  }
  EXPECT_NEAR(bound_of_two(7, 7), 0.25, 1e-12);
}

TEST(AmbiguityBound, IsWeissAndWeinsteinsForTwoPoints) {
  // rho^2 d^2 / 4 with rho = exp(-(sqrt a - sqrt b)^2 / 2).
  EXPECT_NEAR(bound_of_two(4, 9), 0.25 * std::exp(-1), 1e-12);
}

}  // namespace
}  // namespace blindcorner
