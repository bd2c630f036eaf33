// SPDX-License-Identifier: Apache-2.0
/// What a vehicle sees directly: which cells its rays pass through, and where they end.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/planner/grid/grid_geometry.h"

namespace blindcorner {

class RayScene;

/// A direct-looking sensor: level rays from the sensor's place, at several heights.
struct LineOfSightOptions {
  double max_range = 40.0;  ///< m; cells beyond it stay as they are
  /// rad, about the sensor's forward axis; 2 pi: all round.
  double field_of_view = 6.283185307179586;
  /// Lowest and highest ray above the ground (z = 0), m: what a car or a robot can run into. A kerb
  /// is lower, a bridge is higher.
  double lowest = 0.2, highest = 1.6;
  int layers = 4;  ///< rays over each other, evenly from lowest to highest

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// One look around. Indices of cells in rising order; no cell is in two lists or twice in one.
struct LineOfSightScan {
  std::vector<std::size_t> free;          ///< rays of all layers passed through
  std::vector<std::size_t> surface_hits;  ///< a ray ended on the known scene here
  std::vector<std::size_t> object_hits;   ///< a ray ended on something else here
  std::vector<bool> objects_seen;         ///< [hidden objects] whether a ray ended on it
};

/// Casts rays at the known scene, whose acceleration structure is built once.
class LineOfSight {
 public:
  /// Throws Error when options or grid are not valid.
  LineOfSight(const Scene& scene, const GridGeometry& grid, const LineOfSightOptions& options = {});
  ~LineOfSight();
  LineOfSight(const LineOfSight&) = delete;
  LineOfSight& operator=(const LineOfSight&) = delete;

  /// What is seen from a sensor pose, with the scene's hidden objects standing at `objects` (empty:
  /// there are none; else one each, or Error). Directions are so close that no cell within range
  /// lies between two of them; in each, the nearest end among the layers counts. A cell in which
  /// any ray ends is no free one.
  LineOfSightScan scan(const Transform& T_world_sensor,
                       const std::vector<Placement>& objects = {}) const {
    return scan(T_world_sensor, objects, T_world_sensor);
  }
  /// The same by a sensor that takes itself to be at another pose: what it sees is displaced with
  /// it. Both poses differ by a place and a turn over the ground.
  LineOfSightScan scan(const Transform& T_world_sensor, const std::vector<Placement>& objects,
                       const Transform& T_world_believed) const;

 private:
  struct End;
  End nearest_end(const Eigen::Vector2d& from, const Eigen::Vector2d& direction,
                  const RayScene* bodies) const;

  std::vector<HiddenObject> objects_;
  GridGeometry grid_;
  LineOfSightOptions options_;
  std::unique_ptr<const RayScene> surfaces_;
};

}  // namespace blindcorner
