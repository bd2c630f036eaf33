// SPDX-License-Identifier: Apache-2.0
/// Poses on the command line: "x_m=0.3,yaw_deg=20".
#pragma once

#include <map>
#include <string>

#include "blindcorner/forward/scene.h"

namespace blindcorner {

/// Parses NAME=VALUE pairs for the scene's hidden object into its placement; names carry either
/// unit suffix (yaw_deg or yaw_rad). Throws Error naming the argument.
Placement parse_pose(const Scene& scene, const std::string& text);

/// The unknowns of a placement by name: {"x_m": 0.3, ...}.
std::map<std::string, double> truth_of(const Scene& scene, const Placement& placement);

}  // namespace blindcorner
