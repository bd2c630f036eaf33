// SPDX-License-Identifier: Apache-2.0
/// What a vehicle sees directly: the cells that its rays pass through, and the cells in which they
/// end.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/planner/grid/grid_geometry.h"

namespace blindcorner {

class RayScene;

/// A sensor for direct sight: horizontal rays from the sensor's position, at several heights.
struct LineOfSightOptions {
  double max_range = 40.0;  ///< m; cells beyond it remain unchanged
  /// rad, about the sensor's forward axis; 2 pi: all round.
  double field_of_view = 6.283185307179586;
  /// Lowest and highest ray above the ground (z = 0), m: the heights at which a car or a robot can
  /// hit something. A kerb is lower, a bridge is higher.
  double lowest = 0.2, highest = 1.6;
  int layers = 4;  ///< number of rays above each other, evenly spaced from lowest to highest

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// One look around. Indices of cells are in rising order; each cell is in one list at most, and
/// only once.
struct LineOfSightScan {
  std::vector<std::size_t> free;          ///< rays of all layers passed through these cells
  std::vector<std::size_t> surface_hits;  ///< a ray ended on the known scene in these cells
  std::vector<std::size_t> object_hits;   ///< a ray ended on another object in these cells
  std::vector<bool> objects_seen;  ///< [hidden objects] a ray ended on it; empty: grid out of range
};

/// Casts rays at the known scene, whose acceleration structure is built once.
class LineOfSight {
 public:
  /// Throws Error when the options or the grid are not valid.
  LineOfSight(const Scene& scene, const GridGeometry& grid, const LineOfSightOptions& options = {});
  ~LineOfSight();
  LineOfSight(const LineOfSight&) = delete;
  LineOfSight& operator=(const LineOfSight&) = delete;

  /// The scan from a sensor pose, with the scene's hidden objects at `objects` (empty: no objects;
  /// otherwise one placement each, or Error). The directions are so dense that no cell within range
  /// lies between two of them. In each direction the nearest end among the layers counts. A cell in
  /// which any ray ends is not free. Throws Error for a pose that is not finite.
  LineOfSightScan scan(const Transform& T_world_sensor,
                       const std::vector<Placement>& objects = {}) const {
    return scan(T_world_sensor, objects, T_world_sensor);
  }
  /// The same for a sensor that believes itself at another pose: the cells that it sees shift with
  /// that pose. The two poses differ by a translation and a rotation over the ground.
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
