// SPDX-License-Identifier: Apache-2.0
/// States that the single-track models have in common.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/planner/vehicles/vehicle_model.h"

namespace blindcorner {

/// All models begin with these, in CommonRoad's order: m, rad, m/s, rad/s. The kinematic one, which
/// has neither yaw rate nor slip of its own, ends at kKinematicStates.
enum SingleTrackState {
  kX,
  kY,
  kSteering,
  kSpeed,
  kYaw,
  kKinematicStates,
  kYawRate = kKinematicStates,
  kSlip,
  kSingleTrackStates
};

/// [kSingleTrackStates]
std::vector<std::string> single_track_state_names();

/// [kSingleTrackStates] of a vehicle that moves as told.
StateVector single_track_initial(const VehicleState& state);

/// What these states say; yaw rate and slip are 0 where the model has none.
VehicleState single_track_motion(const StateVector& x);

}  // namespace blindcorner
