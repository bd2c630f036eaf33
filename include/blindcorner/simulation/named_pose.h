// SPDX-License-Identifier: Apache-2.0
/// Poses given by the names of their components: x_m, yaw_deg; with several objects, front.x_m.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

using NamedNumber = std::pair<std::string, double>;

/// Throws Error naming `where` unless a pose of the scene's objects has a component of this name.
void check_pose_name(const Scene& scene, const std::string& where, const std::string& name);

/// The scene's placements after the named components are set: x_m, y_m, z_m, yaw_deg or yaw_rad,
/// size. With several objects, the object's name and a dot come before each name. Throws Error
/// naming `where`.
std::vector<Placement> placements_from(const Scene& scene, const std::string& where,
                                       const std::vector<NamedNumber>& values);

/// Throws Error naming `where` unless a pose of a sensor has a component of this name.
void check_sensor_pose_name(const std::string& where, const std::string& name);

/// The scene's sensor pose after the named components are set: x_m, y_m, z_m and yaw, pitch, roll
/// in _deg or _rad. Throws Error naming `where`.
Transform sensor_pose_from(const Scene& scene, const std::string& where,
                           const std::vector<NamedNumber>& values);

}  // namespace blindcorner
