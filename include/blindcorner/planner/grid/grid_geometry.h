// SPDX-License-Identifier: Apache-2.0
/// Position and resolution of a grid of square cells on the ground plane.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

namespace blindcorner {

/// A cell of a grid, or a place outside it. Column 0 has the lowest x, row 0 the lowest y.
struct Cell {
  int column = 0;
  int row = 0;

  bool operator==(const Cell&) const = default;
};

/// Extent and resolution of a grid. Cell values are stored row by row, row 0 first.
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
  /// Storage index of a cell of the grid.
  std::size_t index(const Cell& cell) const {
    return static_cast<std::size_t>(cell.row) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(cell.column);
  }
  /// The cell with a storage index.
  Cell cell(std::size_t index) const;
  /// Centre of a cell, m; also for cells outside the grid.
  Eigen::Vector2d center(const Cell& cell) const {
    return origin + cell_size * Eigen::Vector2d(cell.column + 0.5, cell.row + 0.5);
  }
  /// The cell that contains a point; it may lie outside the grid. A cell includes its lower and
  /// left sides.
  Cell cell_at(const Eigen::Vector2d& point) const {
    const Eigen::Vector2d cells = (point - origin) / cell_size;
    return {whole_below(cells.x()), whole_below(cells.y())};
  }
  /// Cells of the grid that overlap a box (m), row by row; none if the box lies outside the grid.
  std::vector<Cell> cells_in(const Eigen::AlignedBox2d& box) const;

  /// Throws Error naming the field when there is no cell, or when its size is not a positive
  /// number.
  void validate() const;

 private:
  /// Largest integer that is not above `value`, clamped to what an int holds (for points far
  /// outside, and for values that are not numbers).
  static int whole_below(double value) {
    constexpr double kFarthest = std::numeric_limits<int>::max() / 4.0;
    const double kept = value > -kFarthest ? std::min(value, kFarthest) : -kFarthest;
    const int towards_zero = static_cast<int>(kept);
    return towards_zero - (kept < towards_zero ? 1 : 0);
  }
};

}  // namespace blindcorner
