// SPDX-License-Identifier: Apache-2.0
/// A planned path as a file for programs and as a page.
#pragma once

#include <span>
#include <string>

#include "blindcorner/planner/path/path_planner.h"

namespace blindcorner {

/// A request for a path and its answer.
struct PlannedPath {
  std::string map;  ///< name of the map, as the user gave it
  PathRequest request;
  const PlanningGrid& grid;
  const Path& path;
};

/// Text of `path.json`, format "blindcorner.path/1" (docs/plan.md).
std::string path_json(const PlannedPath& planned);

/// A self-contained page with a picture of map and path. `occupancy`: one value per cell, NaN where
/// unknown.
std::string path_page(const PlannedPath& planned, std::span<const double> occupancy);

}  // namespace blindcorner
