// SPDX-License-Identifier: Apache-2.0
/// Where a moving sensor stands in each frame.
#pragma once

#include <vector>

#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

/// `frames` poses (T_world_sensor) from the first to the last of the given poses. Every stretch
/// between two given poses takes the same time, in a straight line and with the shortest rotation.
/// Throws Error without a pose or a frame.
std::vector<Transform> sensor_path(const std::vector<Transform>& through, int frames);

/// End of a path that a vehicle could drive from the scene's sensor pose. The path leads forward
/// along the floor, by 0.3 of the distance at which the optical axis meets a known surface (by 1 m
/// if it meets none). The sensor turns by 0.1 rad towards the search region.
Transform forward_end(const Scene& scene);

/// The scene with its sensor at another pose. Throws Error if the sensor then lights or sees no
/// relay surface.
Scene seen_from(const Scene& scene, const Transform& T_world_sensor);

}  // namespace blindcorner
