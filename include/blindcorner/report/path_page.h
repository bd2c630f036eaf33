// SPDX-License-Identifier: Apache-2.0
/// A planned path as a file for programs and as a page.
#pragma once

#include <span>
#include <string>

#include "blindcorner/planner/path/path_planner.h"

namespace blindcorner {

/// What was asked, and what came of it.
struct PlannedPath {
  std::string map;  ///< as it was named
  PathRequest request;
  const PlanningGrid& grid;
  const Path& path;
};

/// Text of `path.json`, format "blindcorner.path/1" (docs/plan.md).
std::string path_json(const PlannedPath& planned);

/// A self-contained page with a picture of map and path. `occupancy`: per cell, NaN where unknown.
std::string path_page(const PlannedPath& planned, std::span<const double> occupancy);

}  // namespace blindcorner
