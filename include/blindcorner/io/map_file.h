// SPDX-License-Identifier: Apache-2.0
/// A map from any supported kind of file, in the form that planning grids take.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/planner/grid/grid_geometry.h"

namespace blindcorner {

struct OccupancyMap {
  GridGeometry geometry;
  std::vector<double> occupancy;  ///< [cell] probability, NaN: unknown
};

/// Reads a ROS map (.yaml, .yml) or a MovingAI map (.map); the file's ending decides. Throws Error.
OccupancyMap read_map(const std::string& path);

}  // namespace blindcorner
