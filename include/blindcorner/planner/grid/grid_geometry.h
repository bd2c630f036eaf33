// SPDX-License-Identifier: Apache-2.0
/// How a grid of square cells lies on the ground plane.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

namespace blindcorner {

/// A cell of a grid, or a place beside it. Column 0 has the lowest x, row 0 the lowest y.
struct Cell {
  int column = 0;
  int row = 0;

  bool operator==(const Cell&) const = default;
};

/// Extent and resolution of a grid. Values of cells are stored row by row, row 0 first.
struct GridGeometry {
  int columns = 0;
  int rows = 0;
  double cell_size = 0.1;                            ///< m
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();  ///< lower left corner of cell (0, 0), m

  std::size_t cells() const {
    return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  }
  bool contains(const Cell& cell) const {
    return cell.column >= 0 && cell.column < columns && cell.row >= 0 && cell.row < rows;
  }
  /// Where a cell of the grid is stored.
  std::size_t index(const Cell& cell) const {
    return static_cast<std::size_t>(cell.row) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(cell.column);
  }
  /// The cell that is stored at `index`.
  Cell cell(std::size_t index) const;
  /// Centre of a cell, m. Also of cells beside the grid.
  Eigen::Vector2d center(const Cell& cell) const {
    return origin + cell_size * Eigen::Vector2d(cell.column + 0.5, cell.row + 0.5);
  }
  /// The cell that holds a point (its lower and left sides belong to it), maybe beside the grid.
  Cell cell_at(const Eigen::Vector2d& point) const {
    const Eigen::Vector2d cells = (point - origin) / cell_size;
    return {whole_below(cells.x()), whole_below(cells.y())};
  }
  /// Cells of the grid that a box (m) reaches into, row by row; a box beside the grid has none.
  std::vector<Cell> cells_in(const Eigen::AlignedBox2d& box) const;

  /// Throws Error naming the field when there is no cell, or its size is not a positive number.
  void validate() const;

 private:
  /// Whole number not above `value`, kept to what an int holds (for points far outside, and for
  /// what is not a number).
  static int whole_below(double value) {
    constexpr double kFarthest = std::numeric_limits<int>::max() / 4.0;
    const double kept = value > -kFarthest ? std::min(value, kFarthest) : -kFarthest;
    const int towards_zero = static_cast<int>(kept);
    return towards_zero - (kept < towards_zero ? 1 : 0);
  }
};

}  // namespace blindcorner
