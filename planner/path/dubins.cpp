// SPDX-License-Identifier: Apache-2.0
#include "planner/path/dubins.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "blindcorner/forward/constants.h"

namespace blindcorner {
namespace {

/// An angle from 0 to a turn.
double turned(double angle) { return angle - 2 * kPi * std::floor(angle / (2 * kPi)); }

}  // namespace

double dubins_length(const PlanarPose& from, const PlanarPose& to, double radius) {
  const Eigen::Vector2d way = to.position - from.position;
  const double d = way.norm() / radius, course = std::atan2(way.y(), way.x());
  const double a = from.heading - course, b = to.heading - course;
  const double sa = std::sin(a), sb = std::sin(b), ca = std::cos(a), cb = std::cos(b);
  const double cab = std::cos(a - b);
  double least = std::numeric_limits<double>::infinity();
  const auto consider = [&](double first, double middle, double last) {
    least = std::min(least, turned(first) + middle + turned(last));
  };
  // Both turns to the left, and both to the right, with a straight line between them.
  const double same_left = 2 + d * d - 2 * cab + 2 * d * (sa - sb);
  if (same_left >= 0) {
    const double line = std::atan2(cb - ca, d + sa - sb);
    consider(line - a, std::sqrt(same_left), b - line);
  }
  const double same_right = 2 + d * d - 2 * cab + 2 * d * (sb - sa);
  if (same_right >= 0) {
    const double line = std::atan2(ca - cb, d - sa + sb);
    consider(a - line, std::sqrt(same_right), line - b);
  }
  // One to each side.
  const double left_right = d * d - 2 + 2 * cab + 2 * d * (sa + sb);
  if (left_right >= 0) {
    const double middle = std::sqrt(left_right);
    const double line = std::atan2(-ca - cb, d + sa + sb) - std::atan2(-2.0, middle);
    consider(line - a, middle, line - b);
  }
  const double right_left = d * d - 2 + 2 * cab - 2 * d * (sa + sb);
  if (right_left >= 0) {
    const double middle = std::sqrt(right_left);
    const double line = std::atan2(ca + cb, d - sa - sb) - std::atan2(2.0, middle);
    consider(a - line, middle, b - line);
  }
  // Three turns.
  const double right_left_right = (6 - d * d + 2 * cab + 2 * d * (sa - sb)) / 8;
  if (std::abs(right_left_right) <= 1) {
    const double middle = turned(2 * kPi - std::acos(right_left_right));
    const double first = a - std::atan2(ca - cb, d - sa + sb) + middle / 2;
    consider(first, middle, a - b - first + middle);
  }
  const double left_right_left = (6 - d * d + 2 * cab + 2 * d * (sb - sa)) / 8;
  if (std::abs(left_right_left) <= 1) {
    const double middle = turned(2 * kPi - std::acos(left_right_left));
    const double first = -a + std::atan2(cb - ca, d + sa - sb) + middle / 2;
    consider(first, middle, b - a - first + middle);
  }
  return radius * least;
}

}  // namespace blindcorner
