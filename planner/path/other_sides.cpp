// SPDX-License-Identifier: Apache-2.0
#include "planner/path/other_sides.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace blindcorner {
namespace {

/// Lines across a path are looked at in steps of this share of a cell.
constexpr double kStepCells = 0.5;
/// Group of what reaches the map's border, and of what lies beyond it.
constexpr int kMainland = 0;
constexpr int kTraversable = -1;

/// Group of every cell: neighbours by sides or corners belong together, since no step leads between
/// two cells that touch at a corner.
std::vector<int> groups_of(const PlanningGrid& grid) {
  const GridGeometry& geometry = grid.geometry();
  constexpr int kUnseen = -2;
  std::vector<int> group(geometry.cells(), kUnseen);
  std::vector<Cell> open;
  const auto fill = [&](const Cell& from, int name) {
    const auto take = [&](const Cell& cell) {
      if (!geometry.contains(cell) || grid.traversable(cell)) return;
      int& of_cell = group[geometry.index(cell)];
      if (of_cell != kUnseen) return;
      of_cell = name;
      open.push_back(cell);
    };
    take(from);
    while (!open.empty()) {
      const Cell cell = open.back();
      open.pop_back();
      for (std::size_t k = 0; k < kSteps; ++k) {
        take({cell.column + kStepColumns[k], cell.row + kStepRows[k]});
      }
    }
  };
  for (int column = 0; column < geometry.columns; ++column) {
    fill({column, 0}, kMainland);
    fill({column, geometry.rows - 1}, kMainland);
  }
  for (int row = 0; row < geometry.rows; ++row) {
    fill({0, row}, kMainland);
    fill({geometry.columns - 1, row}, kMainland);
  }
  int islands = kMainland;
  for (std::size_t i = 0; i < group.size(); ++i) {
    const Cell cell = geometry.cell(i);
    if (grid.traversable(cell)) {
      group[i] = kTraversable;
    } else if (group[i] == kUnseen) {
      fill(cell, ++islands);
    }
  }
  return group;
}

/// From a point to the first cell of a group in a direction.
struct HalfLine {
  std::vector<Cell> cells;  ///< traversable, the point's own first
  double length = 0;        ///< m
  int group = kMainland;    ///< where it ends
};

HalfLine half_line(const GridGeometry& geometry, const std::vector<int>& group,
                   const Eigen::Vector2d& from, const Eigen::Vector2d& direction) {
  HalfLine line;
  const double step = kStepCells * geometry.cell_size;
  for (;; line.length += step) {
    const Cell cell = geometry.cell_at(from + line.length * direction);
    if (!geometry.contains(cell)) return line;
    const int here = group[geometry.index(cell)];
    if (here != kTraversable) {
      line.group = here;
      return line;
    }
    if (line.cells.empty() || !(line.cells.back() == cell)) line.cells.push_back(cell);
  }
}

}  // namespace

std::vector<Passage> passages_of(const PlanningGrid& grid, const Path& path) {
  const GridGeometry& geometry = grid.geometry();
  const std::vector<int> group = groups_of(grid);
  std::map<std::pair<int, int>, Passage> narrowest;  // between the groups to the left and the right
  for (const PathPoint& point : path.points) {
    const Eigen::Vector2d left(-std::sin(point.heading), std::cos(point.heading));
    HalfLine to_left = half_line(geometry, group, point.position, left);
    const HalfLine to_right = half_line(geometry, group, point.position, -left);
    // A line from a group back to itself ends at no side of it; one from the mainland to the
    // mainland crosses every way there is.
    if (to_left.cells.empty() || to_left.group == to_right.group) continue;
    const double width = to_left.length + to_right.length;
    Passage& passage = narrowest[{to_left.group, to_right.group}];
    if (!passage.cells.empty() && passage.width <= width) continue;
    passage.cells = std::move(to_left.cells);
    passage.cells.insert(passage.cells.end(), to_right.cells.begin(), to_right.cells.end());
    passage.width = width;
  }
  std::vector<Passage> passages;
  for (auto& [sides, passage] : narrowest) passages.push_back(std::move(passage));
  std::ranges::stable_sort(passages, {}, &Passage::width);
  return passages;
}

}  // namespace blindcorner
