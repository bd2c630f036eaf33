// SPDX-License-Identifier: Apache-2.0
/// Poses on the command line: "x_m=0.3,yaw_deg=20", with several objects "front.x_m=0.3".
#pragma once

#include <map>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

/// Parses NAME=VALUE pairs into the placements of the scene's hidden objects; names carry either
/// unit suffix (yaw_deg or yaw_rad) and, where there are several objects, the object's name before
/// a dot. What is not named keeps the scene's value. Throws Error naming the argument.
std::vector<Placement> parse_pose(const Scene& scene, const std::string& text);

/// The unknowns at some placements by name: {"x_m": 0.3, ...}.
std::map<std::string, double> truth_of(const Scene& scene,
                                       const std::vector<Placement>& placements);

}  // namespace blindcorner
