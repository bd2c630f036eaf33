// SPDX-License-Identifier: Apache-2.0
#include "planner/path/spline.h"

#include <algorithm>

namespace blindcorner {
namespace {

/// Symmetric matrix with two diagonals beside the main one, [diagonal][row], solved by L D L'.
class PentadiagonalSystem {
 public:
  explicit PentadiagonalSystem(std::span<const double> weights)
      : main_(weights.begin(), weights.end()),
        first_(weights.size(), 0),
        second_(weights.size(), 0) {
    // Second differences p[i-1] - 2 p[i] + p[i+1], squared and summed.
    for (std::size_t i = 1; i + 1 < weights.size(); ++i) {
      main_[i - 1] += 1;
      main_[i] += 4;
      main_[i + 1] += 1;
      first_[i - 1] -= 2;
      first_[i] -= 2;
      second_[i - 1] += 1;
    }
  }

  /// Replaces the right side by the solution. The matrix is used up.
  void solve(std::vector<Eigen::Vector2d>& right) {
    const std::size_t n = main_.size();
    for (std::size_t i = 0; i < n; ++i) {
      // Column i of L is eliminated from the two rows below.
      const double below = first_[i] / main_[i], second_below = second_[i] / main_[i];
      if (i + 1 < n) {
        main_[i + 1] -= below * first_[i];
        first_[i + 1] -= below * second_[i];
        right[i + 1] -= below * right[i];
      }
      if (i + 2 < n) {
        main_[i + 2] -= second_below * second_[i];
        right[i + 2] -= second_below * right[i];
      }
      right[i] /= main_[i];
      first_[i] = below;
      second_[i] = second_below;
    }
    for (std::size_t i = n; i-- > 0;) {
      if (i + 1 < n) right[i] -= first_[i] * right[i + 1];
      if (i + 2 < n) right[i] -= second_[i] * right[i + 2];
    }
  }

 private:
  std::vector<double> main_, first_, second_;
};

}  // namespace

std::vector<CubicBezier> spline_pieces(std::span<const Eigen::Vector2d> control,
                                       const Eigen::Vector2d& start_bend) {
  const std::size_t n = control.size();
  const auto at = [&](std::size_t i) -> Eigen::Vector2d {  // 0: the mirrored point before the first
    if (i == 0) return 2 * control[0] - control[1] + start_bend;
    if (i == n + 1) return 2 * control[n - 1] - control[n - 2];
    return control[i - 1];
  };
  std::vector<CubicBezier> pieces;
  for (std::size_t i = 1; i < n; ++i) {
    const Eigen::Vector2d a = at(i - 1), b = at(i), c = at(i + 1), d = at(i + 2);
    pieces.push_back(
        {{(a + 4 * b + c) / 6, (2 * b + c) / 3, (b + 2 * c) / 3, (b + 4 * c + d) / 6}});
  }
  return pieces;
}

std::vector<Eigen::Vector2d> subdivided(std::span<const Eigen::Vector2d> control,
                                        const Eigen::Vector2d& start_bend) {
  const std::size_t n = control.size();
  std::vector<Eigen::Vector2d> points;
  for (std::size_t i = 0; i < n; ++i) {
    if (i > 0) points.emplace_back((control[i - 1] + control[i]) / 2);
    if (i == 0) {
      points.emplace_back(control[0] + start_bend / 8);
    } else if (i + 1 < n) {
      points.emplace_back((control[i - 1] + 6 * control[i] + control[i + 1]) / 8);
    } else {
      points.push_back(control[i]);
    }
  }
  return points;
}

std::vector<Eigen::Vector2d> flattened(std::span<const Eigen::Vector2d> targets,
                                       std::span<const double> weights) {
  std::vector<Eigen::Vector2d> points(targets.size());
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = weights[i] * targets[i];
  PentadiagonalSystem(weights).solve(points);
  return points;
}

double polyline_length(std::span<const Eigen::Vector2d> corners) {
  double length = 0;
  for (std::size_t i = 1; i < corners.size(); ++i) length += (corners[i] - corners[i - 1]).norm();
  return length;
}

std::vector<Eigen::Vector2d> evenly_spaced(std::span<const Eigen::Vector2d> corners,
                                           std::size_t count) {
  const double spacing = polyline_length(corners) / static_cast<double>(count - 1);
  std::vector<Eigen::Vector2d> points{corners.front()};
  double passed = 0;  // length before the present line
  std::size_t line = 1;
  while (points.size() + 1 < count) {
    const double wanted = spacing * static_cast<double>(points.size());
    double length = (corners[line] - corners[line - 1]).norm();
    while (line + 1 < corners.size() && passed + length < wanted) {
      passed += length;
      ++line;
      length = (corners[line] - corners[line - 1]).norm();
    }
    const double share = length > 0 ? std::min((wanted - passed) / length, 1.0) : 0;
    points.push_back(corners[line - 1] + share * (corners[line] - corners[line - 1]));
  }
  points.push_back(corners.back());
  return points;
}

}  // namespace blindcorner
