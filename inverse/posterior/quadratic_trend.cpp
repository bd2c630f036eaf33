// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/quadratic_trend.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace blindcorner {
namespace {

/// Prior standard deviations of the slopes and of the second-order coefficients, of changes in log
/// posterior over a standard deviation: lights that differ by more are not compared
/// (posterior.cpp).
constexpr double kSlope = 2, kCurvature = 1;

Eigen::VectorXd monomials(const Eigen::VectorXd& x) {
  Eigen::VectorXd row(QuadraticTrend::coefficients(x.size()));
  Eigen::Index at = 0;
  row[at++] = 1;
  for (Eigen::Index i = 0; i < x.size(); ++i) row[at++] = x[i];
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    for (Eigen::Index j = i; j < x.size(); ++j) row[at++] = x[i] * x[j];
  }
  return row;
}

}  // namespace

QuadraticTrend::QuadraticTrend(const std::vector<Eigen::VectorXd>& points,
                               const std::vector<double>& values, double noise) {
  if (points.empty()) return;
  const auto [least, most] = std::ranges::minmax(values);
  least_ = least;
  most_ = most;
  const Eigen::Index n = points.front().size();
  Eigen::VectorXd spread = Eigen::VectorXd::Constant(coefficients(n), kCurvature);
  spread.head(n + 1).setConstant(kSlope);
  Eigen::MatrixXd precision = spread.array().square().inverse().matrix().asDiagonal();
  precision(0, 0) = 0;  // the level is free
  Eigen::VectorXd right = Eigen::VectorXd::Zero(spread.size());
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Eigen::VectorXd row = monomials(points[k]) / noise;
    precision += row * row.transpose();
    right += row * values[k] / noise;
  }
  coefficients_ = precision.ldlt().solve(right);
}

double QuadraticTrend::operator()(const Eigen::VectorXd& point) const {
  if (coefficients_.size() == 0) return 0;
  return std::clamp(coefficients_.dot(monomials(point)), least_, most_);
}

}  // namespace blindcorner
