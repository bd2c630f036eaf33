// SPDX-License-Identifier: Apache-2.0
/// Single track whose wheels roll where they point (CommonRoad's KS).
#pragma once

#include <memory>

#include "blindcorner/planner/vehicles/single_track_parameters.h"
#include "blindcorner/planner/vehicles/vehicle_model.h"

namespace blindcorner {

/// States: x, y of the rear axle (m), steering angle (rad), speed (m/s), yaw (rad).
///   dx = v cos(yaw), dy = v sin(yaw), dyaw = v tan(steering) / wheelbase
/// Negative acceleration does not stop at standstill: it drives backwards.
std::shared_ptr<const VehicleModel> make_kinematic_single_track(
    const SingleTrackParameters& parameters = {});

}  // namespace blindcorner
