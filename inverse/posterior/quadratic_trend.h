// SPDX-License-Identifier: Apache-2.0
/// A smooth function of the pose from a few of its values.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace blindcorner {

/// Quadratic through values at points, by ridge regression: few or badly spread points give a flat
/// answer instead of a wild one. Coordinates are in standard deviations of whatever the points are
/// drawn from, so that points are of the order of 1.
class QuadraticTrend {
 public:
  /// `noise`: standard deviation of a value about the quadratic.
  QuadraticTrend(const std::vector<Eigen::VectorXd>& points, const std::vector<double>& values,
                 double noise);

  /// Coefficients of `n` coordinates.
  static int coefficients(std::ptrdiff_t n) { return static_cast<int>((n + 1) * (n + 2) / 2); }

  /// Between the least and the largest value that it was made from.
  double operator()(const Eigen::VectorXd& point) const;

 private:
  Eigen::VectorXd coefficients_;
  double least_ = 0, most_ = 0;
};

}  // namespace blindcorner
