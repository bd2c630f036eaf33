// SPDX-License-Identifier: Apache-2.0
/// Poses of objects on the command line: "x_m=0.3,yaw_deg=20", with several objects
/// "front.x_m=0.3". Poses of the sensor, on the command line or in a table.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

/// Parses NAME=VALUE pairs into the placements of the scene's hidden objects; names carry either
/// unit suffix (yaw_deg or yaw_rad) and, where there are several objects, the object's name before
/// a dot. What is not named keeps the scene's value. Throws Error naming the argument.
std::vector<Placement> parse_pose(const Scene& scene, const std::string& text);

/// Parses a pose of the sensor, NAME=VALUE pairs of x_m, y_m, z_m, and yaw, pitch and roll in
/// either unit. What is not named keeps the scene's value. Throws Error naming `option`.
Transform parse_sensor_pose(const Scene& scene, const std::string& option, const std::string& text);

/// Poses of the sensor, one from each row of a table (.csv) whose header holds these names. Throws
/// Error.
std::vector<Transform> read_sensor_poses(const Scene& scene, const std::string& path);

}  // namespace blindcorner
