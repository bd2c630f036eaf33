// SPDX-License-Identifier: Apache-2.0
/// Where a moving sensor stands in each frame.
#pragma once

#include <vector>

#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

/// `frames` poses (T_world_sensor) from the first to the last of the given ones. Every stretch
/// between two of them takes the same time, in a straight line and with the shortest rotation.
/// Throws Error without a pose or a frame.
std::vector<Transform> sensor_path(const std::vector<Transform>& through, int frames);

/// End of a path that a vehicle could drive from the scene's sensor pose: as far forward along the
/// floor as 0.3 of the distance at which its optical axis meets a known surface (1 m where it meets
/// none), turned by 0.1 rad towards the search region.
Transform forward_end(const Scene& scene);

/// The scene with its sensor elsewhere. Throws Error when the sensor then lights or sees no relay.
Scene seen_from(const Scene& scene, const Transform& T_world_sensor);

}  // namespace blindcorner
