// SPDX-License-Identifier: Apache-2.0
#include "planner/vehicles/single_track_states.h"

namespace blindcorner {

std::vector<std::string> single_track_state_names() {
  return {"x_m",     "y_m", "steering_rad", "speed_m_per_s", "yaw_rad", "yaw_rate_rad_per_s",
          "slip_rad"};
}

StateVector single_track_initial(const VehicleState& state) {
  StateVector x(kSingleTrackStates);
  x << state.position, state.steering_angle, state.speed, state.yaw, state.yaw_rate,
      state.slip_angle;
  return x;
}

VehicleState single_track_motion(const StateVector& x) {
  VehicleState motion{
      .position = x.head<2>(), .yaw = x[kYaw], .speed = x[kSpeed], .steering_angle = x[kSteering]};
  if (x.size() > kKinematicStates) motion.yaw_rate = x[kYawRate], motion.slip_angle = x[kSlip];
  return motion;
}

}  // namespace blindcorner
