// SPDX-License-Identifier: Apache-2.0
/// The cells that one hidden object occupies, under one mode of a mixture.
#pragma once

#include <span>
#include <vector>

#include "blindcorner/planner/grid/grid_geometry.h"
#include "planner/grid/object_marginal.h"

namespace blindcorner {

/// Part of the grid with values of its own.
struct Window {
  int first_column = 0, first_row = 0;
  int columns = 0, rows = 0;
  std::vector<double> values;
};

/// Probability that one object occupies the cells and has not been seen.
struct ObjectSpread {
  Window window;
  double not_seen = 1;
};

/// Sums over positions on a lattice (pose_spread.h says how fine) and over shapes. `not_seen` is
/// [cells] or empty: the probability that an object which covers the cell's centre would have
/// remained unseen. The window's values are probabilities that the object occupies the cell and has
/// remained unseen. Divided by the result's `not_seen`, they are probabilities given that it has.
///
/// A pose has remained unseen with the smallest `not_seen` of the cells that it covers and of the
/// cell that it stands in. All shapes are summed before they are placed at a position. The mean
/// over the shapes is then bounded from above, at each position by the cell that says most against
/// all shapes together, and in each cell by what was seen there. With a single shape both bounds
/// are exact.
ObjectSpread spread(const ObjectMarginal& marginal, const GroundObject& object,
                    const GridGeometry& grid, std::span<const double> not_seen);

}  // namespace blindcorner
