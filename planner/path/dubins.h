// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "blindcorner/planner/path/vehicle_footprint.h"

namespace blindcorner {

/// Length of the shortest curve from one pose to another that turns no tighter than `radius`, m,
/// where nothing stands in the way (Dubins 1957; formulas of Shkel and Lumelsky 2001).
double dubins_length(const PlanarPose& from, const PlanarPose& to, double radius);

}  // namespace blindcorner
