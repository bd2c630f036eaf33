// SPDX-License-Identifier: Apache-2.0
/// Cheapest way over the cells of a planning grid: A* (Hart, Nilsson & Raphael 1968).
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "blindcorner/planner/path/planning_grid.h"

namespace blindcorner {

/// How a search ended; what is wrong with the start is told before what is wrong with the goal.
enum class PathStatus {
  found,
  no_path,        ///< start and goal are free, but nothing connects them
  start_outside,  ///< of the map
  goal_outside,   ///< of the map
  start_blocked,  ///< inside an obstacle or nearer to one than the vehicle allows
  goal_blocked,   ///< likewise
};
/// "found", "no_path", ... as files have it.
std::string_view path_status_word(PathStatus status);

struct GridSearchOptions {
  /// Factor on the heuristic: 1 finds the optimum, w > 1 a path at most w times as costly, with
  /// fewer expansions (Pohl 1970). Accepted: 1 or more.
  double heuristic_weight = 1;

  /// Throws Error naming the field.
  void validate() const;
};

struct CellPath {
  PathStatus status = PathStatus::no_path;
  std::vector<Cell> cells;     ///< from start to goal; empty unless found
  double length = 0;           ///< m, of the line through the cells' centres
  double cost = 0;             ///< m, the length weighted with the cost factors
  std::size_t expansions = 0;  ///< cells whose steps were tried
};

/// A* with eight neighbours. A step costs its length times the mean cost factor of its two cells,
/// which is the line integral of the factor. The heuristic is the octile distance times the least
/// factor, consistent, so that the path found is optimal. The workspace is kept: further searches
/// on grids of the same size allocate nothing but the answer. Not thread safe.
class GridSearch {
 public:
  explicit GridSearch(const GridSearchOptions& options = {});

  CellPath search(const PlanningGrid& grid, const Cell& start, const Cell& goal);

 private:
  struct Node {
    double cost = 0;           ///< of the cheapest way known, cells
    std::uint32_t search = 0;  ///< that wrote this node: others do not count
    std::uint8_t step = 0;     ///< that led here
    bool expanded = false;
  };
  struct Entry {
    double key = 0;
    double cost = 0;
    std::uint32_t index = 0;
  };
  void prepare(std::size_t cells);
  void push(const Entry& entry);
  Entry pop();
  CellPath trace(const PlanningGrid& grid, const Cell& start, const Cell& goal) const;

  GridSearchOptions options_;
  std::vector<Node> nodes_;
  std::vector<Entry> heap_;
  std::uint32_t search_ = 0;
};

}  // namespace blindcorner
