// SPDX-License-Identifier: Apache-2.0
/// A map from whichever kind of file holds it, as planning grids take it.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/planner/grid/grid_geometry.h"

namespace blindcorner {

struct OccupancyMap {
  GridGeometry geometry;
  std::vector<double> occupancy;  ///< [cell] probability, NaN: unknown
};

/// Reads a ROS map (.yaml, .yml) or a MovingAI map (.map), told apart by the file's ending. Throws
/// Error.
OccupancyMap read_map(const std::string& path);

}  // namespace blindcorner
