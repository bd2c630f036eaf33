// SPDX-License-Identifier: Apache-2.0
/// Ways that pass an obstacle on its other side.
#pragma once

#include <vector>

#include "blindcorner/planner/path/path.h"
#include "blindcorner/planner/path/planning_grid.h"

namespace blindcorner {

/// Where a path passes between two groups of cells that it must not touch: the cells of the
/// narrowest line across it from one group to the other.
struct Passage {
  std::vector<Cell> cells;
  double width = 0;  ///< m
};

/// The passages of a path that was found beside each island, the narrowest first. An island is a
/// group of neighbouring cells that are not traversable and do not reach the map's border: whoever
/// must not use a passage beside it may pass it on its other side.
std::vector<Passage> passages_of(const PlanningGrid& grid, const Path& path);

}  // namespace blindcorner
