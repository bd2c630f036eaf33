// SPDX-License-Identifier: Apache-2.0
/// Shares of lattice pixels that polygons cover.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "blindcorner/forward/scene/footprint.h"

namespace blindcorner {

/// Pixels (column, row) of width `step` (m) whose centres are at `step * (column, row) - shift`.
struct FootprintKernel {
  double step = 1.0;
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();
  int first_column = 0, first_row = 0;
  int columns = 0, rows = 0;
  std::vector<double> values;  ///< [rows, columns] row by row

  double& at(int column, int row) {
    return values[static_cast<std::size_t>(row - first_row) * static_cast<std::size_t>(columns) +
                  static_cast<std::size_t>(column - first_column)];
  }
};

/// A kernel of zeros that holds all points between two corners, with `margin` pixels to spare.
FootprintKernel empty_kernel(double step, const Eigen::Vector2d& shift,
                             const Eigen::Vector2d& lower, const Eigen::Vector2d& upper,
                             int margin);

/// Adds `weight` times the share of each pixel that a convex polygon covers. Exact for edges along
/// the axes; a slanted edge is taken as vertical within each row of pixels. The kernel must hold
/// the polygon.
void add_polygon(const Footprint& polygon, double weight, FootprintKernel& kernel);

/// Averages over squares of `width` by `width` pixels; `width` is odd.
void box_average(int width, FootprintKernel& kernel);

/// Minkowski sum of a convex polygon with a square of width `side` about the origin.
Footprint widened(const Footprint& polygon, double side);

}  // namespace blindcorner
