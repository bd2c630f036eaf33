// SPDX-License-Identifier: Apache-2.0
/// Outlines of a scene seen from above, for the report.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

/// Corners in x and y, m, counter-clockwise; two corners for something seen edge-on.
using Outline = std::vector<Eigen::Vector2d>;

/// What a sensor at one place sees of the known surfaces.
struct SensorOutlines {
  Eigen::Vector3d position;  ///< m, world
  Eigen::Vector3d forward;   ///< optical axis, unit, world
  Outline field_of_view;     ///< of all zones, from the sensor to the surfaces they see
  /// Where each zone's directions end: one outline per surface that it sees.
  std::vector<std::vector<Outline>> zones;
};

/// `relay_points` replace the zones' footprints when there is one per zone.
SensorOutlines sensor_outlines(const Scene& scene, const Transform& T_world_sensor,
                               const std::vector<Eigen::Vector3d>& relay_points);

}  // namespace blindcorner
