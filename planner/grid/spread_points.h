// SPDX-License-Identifier: Apache-2.0
/// Points that fill a cube evenly, and normally distributed points that are made from them.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>

#include "blindcorner/forward/constants.h"

namespace blindcorner {

/// Point i of the additive recurrence in `kDimensions` dimensions, each in (0, 1) (Roberts 2018).
/// `ratio`: the root above 1 of x^(dimensions + 1) = x + 1.
template <std::size_t kDimensions>
std::array<double, kDimensions> spread_point(int i, double ratio) {
  std::array<double, kDimensions> point{};
  double step = 1;
  for (double& value : point) {
    step /= ratio;
    const double sum = 0.5 + step * (i + 1);
    value = sum - std::floor(sum);
  }
  return point;
}

/// Point of the standard normal distribution for a point (a, b) of the unit square (Box and Muller
/// 1958). Points that fill the square evenly become normally distributed.
inline Eigen::Vector2d normal_point(double a, double b) {
  const double radius = std::sqrt(-2 * std::log(1 - a));
  return radius * Eigen::Vector2d(std::cos(2 * kPi * b), std::sin(2 * kPi * b));
}

}  // namespace blindcorner
