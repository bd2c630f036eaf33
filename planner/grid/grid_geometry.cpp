// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/grid/grid_geometry.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "blindcorner/forward/error.h"

namespace blindcorner {

Cell GridGeometry::cell(std::size_t index) const {
  const auto width = static_cast<std::size_t>(columns);
  return {static_cast<int>(index % width), static_cast<int>(index / width)};
}

std::vector<Cell> GridGeometry::cells_in(const Eigen::AlignedBox2d& box) const {
  const Cell low = cell_at(box.min()), high = cell_at(box.max());
  std::vector<Cell> cells;
  for (int row = std::max(0, low.row); row <= std::min(high.row, rows - 1); ++row) {
    for (int column = std::max(0, low.column); column <= std::min(high.column, columns - 1);
         ++column) {
      cells.push_back({column, row});
    }
  }
  return cells;
}

void GridGeometry::validate() const {
  if (columns < 1) {
    throw Error("GridGeometry.columns = " + std::to_string(columns) + "; accepted: 1 or more");
  }
  if (rows < 1) {
    throw Error("GridGeometry.rows = " + std::to_string(rows) + "; accepted: 1 or more");
  }
  if (!(cell_size > 0) || !std::isfinite(cell_size)) {
    throw Error("GridGeometry.cell_size = " + std::to_string(cell_size) +
                "; accepted: a number of metres > 0");
  }
  if (!origin.allFinite()) throw Error("GridGeometry.origin is not a point; accepted: two numbers");
}

}  // namespace blindcorner
