// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <limits>

#include "planner/path/turning_path.h"

namespace blindcorner {
namespace {

/// Relative rounding of sums of line costs.
constexpr double kRounding = 1e-9;

/// From each corner the line is drawn on as long as it is free and costs no more than what it
/// replaces.
std::vector<Eigen::Vector2d> drawn_from_start(const PlanningGrid& grid,
                                              std::span<const Eigen::Vector2d> points) {
  std::vector<Eigen::Vector2d> corners{points.front()};
  double replaced = grid.line_cost(points[0], points[1]);  // since the last corner
  for (std::size_t i = 2; i < points.size(); ++i) {
    const double stretch = grid.line_cost(points[i - 1], points[i]);
    const double line = grid.line_cost(corners.back(), points[i]);
    if (line <= (replaced + stretch) * (1 + kRounding) &&
        line < std::numeric_limits<double>::infinity()) {
      replaced = line;  // so that gains of earlier shortcuts are not given away
    } else {
      corners.push_back(points[i - 1]);
      replaced = stretch;
    }
  }
  corners.push_back(points.back());
  return corners;
}

}  // namespace

std::vector<Eigen::Vector2d> shortcut(const PlanningGrid& grid,
                                      std::span<const Eigen::Vector2d> points) {
  if (points.size() < 3) return {points.begin(), points.end()};
  std::vector<Eigen::Vector2d> corners = drawn_from_start(grid, points);
  std::ranges::reverse(corners);
  corners = drawn_from_start(grid, corners);
  std::ranges::reverse(corners);
  return corners;
}

}  // namespace blindcorner
