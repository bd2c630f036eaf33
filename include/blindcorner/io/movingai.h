// SPDX-License-Identifier: Apache-2.0
/// Maps and problems of the MovingAI benchmark (Sturtevant, "Benchmarks for Grid-Based
/// Pathfinding", IEEE Trans. Comput. Intell. AI Games 2012).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "blindcorner/planner/grid/grid_geometry.h"

namespace blindcorner {

/// The terrain of a cell. Paths stay on the terrain on which they start, by the benchmark's rules
/// (its README: water is "traversable, but not passable from terrain").
enum class Terrain : std::uint8_t {
  blocked,  ///< '@', 'O', 'T'
  ground,   ///< '.', 'G', 'S'
  water,    ///< 'W'
};

/// A map. Files have row 0 at the top; here row 0 is the lowest, so that y points up.
struct MovingAiMap {
  GridGeometry geometry;         ///< cells of 1 m, origin (0, 0)
  std::vector<Terrain> terrain;  ///< [cell]

  /// 0 on the terrain `free`, 1 elsewhere, as planning grids take it.
  std::vector<double> occupancy(Terrain free = Terrain::ground) const;
};

/// A problem whose optimum is known.
struct MovingAiProblem {
  int bucket = 0;
  Cell start, goal;   ///< in a map's rows, the lowest first
  double length = 0;  ///< cells
  /// Largest error of `length` from its rounding, cells: half a unit of the last digit. If the file
  /// shows at most six significant digits, the last digit is the sixth.
  double rounding = 0;
};

/// Reads `type octile`, `height`, `width`, `map` and as many rows as `height` says. Throws Error
/// naming file, line, what was found and what is accepted.
MovingAiMap read_movingai_map(const std::string& path);

/// Reads the problems of a `.scen` file for a map of this size. Throws Error in the same way, also
/// when the file is for a map of another size or a cell is not on the map.
std::vector<MovingAiProblem> read_movingai_scenario(const std::string& path,
                                                    const GridGeometry& geometry);

}  // namespace blindcorner
