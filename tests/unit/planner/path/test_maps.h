// SPDX-License-Identifier: Apache-2.0
/// Small maps for tests of the path planner.
#pragma once

#include <algorithm>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "blindcorner/planner/path/planning_grid.h"

namespace blindcorner {

struct TestMap {
  GridGeometry geometry;
  std::vector<double> occupancy;
};

/// From rows of text, the top row first: '#' occupied, '?' unknown, all else free.
inline TestMap map_of(std::vector<std::string> rows, double cell_size = 1) {
  std::ranges::reverse(rows);
  TestMap map;
  map.geometry = {.columns = static_cast<int>(rows.front().size()),
                  .rows = static_cast<int>(rows.size()),
                  .cell_size = cell_size};
  for (const std::string& row : rows) {
    for (const char c : row) {
      map.occupancy.push_back(c == '#'   ? 1
                              : c == '?' ? std::numeric_limits<double>::quiet_NaN()
                                         : 0);
    }
  }
  return map;
}

/// Cells are obstacles with probability `share`; the others get probabilities up to `most_risk`.
inline TestMap random_map(std::mt19937_64& random, int columns, int rows, double share,
                          double most_risk = 0, double cell_size = 1) {
  TestMap map;
  map.geometry = {.columns = columns, .rows = rows, .cell_size = cell_size};
  std::uniform_real_distribution<double> uniform(0, 1);
  for (std::size_t i = 0; i < map.geometry.cells(); ++i) {
    const bool obstacle = uniform(random) < share;
    const double risk = most_risk * uniform(random);
    map.occupancy.push_back(obstacle ? 1 : risk);
  }
  return map;
}

/// A free place with rectangular blocks in it.
inline TestMap blocks_map(std::mt19937_64& random, int cells, double cell_size, int blocks,
                          int largest) {
  TestMap map;
  map.geometry = {.columns = cells, .rows = cells, .cell_size = cell_size};
  map.occupancy.assign(map.geometry.cells(), 0);
  std::uniform_int_distribution<int> place(0, cells - 1), size(1, largest);
  for (int b = 0; b < blocks; ++b) {
    const Cell corner{place(random), place(random)};
    const int width = size(random), height = size(random);
    for (int row = corner.row; row < std::min(cells, corner.row + height); ++row) {
      for (int column = corner.column; column < std::min(cells, corner.column + width); ++column) {
        map.occupancy[map.geometry.index({column, row})] = 1;
      }
    }
  }
  return map;
}

}  // namespace blindcorner
