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

/// Positions and shapes on a lattice (pose_spread.h says how fine). `not_seen` [cells] or empty:
/// the probability that the object would have remained unseen had it covered the cell's centre. The
/// values sum over what was not seen; divided by `not_seen` they are the probabilities given that.
///
/// A pose has remained unseen with the smallest `not_seen` of the cells that it covers and of the
/// one it stands in. Shapes are summed before they are placed: at each position their mean is
/// bounded from above by the cell that says most against them together, and in each cell by what
/// was seen there. With one shape both are exact.
ObjectSpread spread(const ObjectMarginal& marginal, const GroundObject& object,
                    const GridGeometry& grid, std::span<const double> not_seen);

}  // namespace blindcorner
