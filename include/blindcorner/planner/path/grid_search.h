// SPDX-License-Identifier: Apache-2.0
/// Cheapest way over the cells of a planning grid: A* (Hart, Nilsson & Raphael 1968).
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "blindcorner/planner/path/planning_grid.h"

namespace blindcorner {

/// How a search ended. An error of the start is reported before an error of the goal.
enum class PathStatus {
  found,
  no_path,        ///< start and goal are free, but nothing connects them
  start_outside,  ///< the start is outside the map
  goal_outside,   ///< the goal is outside the map
  start_blocked,  ///< the start is in an obstacle or nearer to one than the vehicle allows
  goal_blocked,   ///< the same for the goal
};
/// "found", "no_path", ... as written in files.
std::string_view path_status_word(PathStatus status);

struct GridSearchOptions {
  /// Factor on the heuristic: 1 finds the optimum. w > 1 finds a path that costs at most w times as
  /// much, with fewer expansions (Pohl 1970). Accepted: 1 or more.
  double heuristic_weight = 1;

  /// Throws Error naming the field.
  void validate() const;
};

struct CellPath {
  PathStatus status = PathStatus::no_path;
  std::vector<Cell> cells;     ///< from the start to the goal; empty unless found
  double length = 0;           ///< m, of the line through the cells' centres
  double cost = 0;             ///< m, the length weighted with the cost factors
  std::size_t expansions = 0;  ///< cells from which steps were tried
};

/// A* with eight neighbours. A step costs its length times the mean cost factor of its two cells,
/// which is the line integral of the factor. The heuristic is the octile distance times the least
/// factor. It is consistent, so that a search with weight 1 finds an optimal path.
///
/// Open cells wait in buckets of equal width, sorted by the estimated cost of a path through them.
/// Within a bucket the newest cell comes first, whatever its estimate. A cell that is reached more
/// cheaply later is expanded again. The goal's cost is final once no open cell's estimate is below
/// it.
///
/// The search keeps its workspace: further searches on grids of the same size allocate only the
/// answer. Not thread safe.
class GridSearch {
 public:
  explicit GridSearch(const GridSearchOptions& options = {});

  CellPath search(const PlanningGrid& grid, const Cell& start, const Cell& goal);
  /// [cells] least cost of a way from each cell to one of `goals`, m; infinite where there is no
  /// way. Goals that are not traversable are ignored.
  std::vector<double> costs_to(const PlanningGrid& grid, std::span<const Cell> goals);

 private:
  struct OpenCell {
    double cost = 0;  ///< of the way by which the cell was reached, cells
    std::uint32_t index = 0;
  };
  void prepare(const PlanningGrid& grid, const Cell& goal);
  void expand(const PlanningGrid& grid, const OpenCell& open);
  void reach(const Cell& cell, std::size_t index, double cost, std::uint8_t step);
  double estimate(const Cell& cell) const;
  Cell cell_at(std::uint32_t index) const {
    return {static_cast<int>(index % columns_), static_cast<int>(index / columns_)};
  }
  bool pop(OpenCell& open, double bound);
  CellPath trace(const PlanningGrid& grid, const Cell& start, const Cell& goal) const;

  GridSearchOptions options_;
  // Of the present search.
  Cell goal_;
  std::uint32_t columns_ = 1;
  double estimate_scale_ = 1;       ///< heuristic weight times least cost factor
  std::vector<double> cost_;        ///< [cell]: of the cheapest known way, cells; infinite: no way
  std::vector<std::uint8_t> step_;  ///< [cell]: the last step of that way
  std::vector<std::uint32_t> reached_;  ///< cells with a cost, to be cleared before the next search
  std::vector<std::vector<OpenCell>> buckets_;
  std::size_t lowest_ = 0;  ///< no bucket below it holds an open cell
};

}  // namespace blindcorner
