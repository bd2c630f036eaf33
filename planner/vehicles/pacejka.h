// SPDX-License-Identifier: Apache-2.0
/// Forces of Pacejka's tyre.
#pragma once

#include <Eigen/Core>

#include "blindcorner/planner/vehicles/single_track_drift.h"

namespace blindcorner {

/// Force in the wheel's frame (x forwards, y to the left), N. `slip` is 1 - R w / u (1: locked),
/// `slip_angle` in rad (positive: the hub moves to the left), `load` in N.
Eigen::Vector2d pacejka_force(const PacejkaTyre& tyre, double slip, double slip_angle, double load);

}  // namespace blindcorner
