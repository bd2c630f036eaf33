// SPDX-License-Identifier: Apache-2.0
/// Single track that rolls without slip, seen from the centre of gravity: what the CommonRoad
/// models become at low speed.
#pragma once

#include "blindcorner/planner/vehicles/single_track_parameters.h"

namespace blindcorner {

/// What the kinematic model needs of a dynamic one. rad, m/s, rad/s, m/s^2.
struct SlowMotion {
  double steering = 0, speed = 0, yaw = 0, slip_angle = 0;
  double steering_rate = 0, acceleration = 0;
};

/// Derivatives of position (m/s), yaw (rad/s), yaw rate (rad/s^2) and slip angle (rad/s).
struct SlowDerivative {
  double x = 0, y = 0, yaw = 0, yaw_rate = 0, slip_angle = 0;
};

SlowDerivative slow_derivative(const SingleTrackParameters& parameters, const SlowMotion& motion);

}  // namespace blindcorner
