// SPDX-License-Identifier: Apache-2.0
/// The car of the drives: single track with wheel slip and friction circle, from standstill up.
#pragma once

#include <memory>

#include "blindcorner/planner/vehicles/single_track_parameters.h"
#include "blindcorner/planner/vehicles/vehicle_model.h"

namespace blindcorner {

/// Tyres are Pacejka's isotropic brushes ("Tyre and Vehicle Dynamics" (2012), section 3.2):
///   slip  s = (R w - u, -v) / sqrt((R w)^2 + e^2)   (u, v: the hub's velocity in the wheel's
///   frame) force F = mu load (1 - (1 - |s|/s_max)^3) s/|s|,  mu load s/|s| from s_max = 3
///   mu/stiffness on
/// so force and slip are parallel, no force exceeds the friction circle, and none does work on the
/// car. e keeps slip finite at rest, where the tyre is a damper: it lowers the slip stiffness by
/// the factor |R w| / sqrt((R w)^2 + e^2), that is by e^2 / (2 (R w)^2), 0.5 % at 1 m/s.
struct CarParameters {
  SingleTrackParameters body{.length = 4.5, .width = 1.8};  ///< measures of the published street
  double friction = 0.9;                                    ///< mu, published
  double slip_stiffness = 21.92;  ///< force / (load slip): -p_ky1 of CommonRoad's tyre
  double slip_speed = 0.1;        ///< e, m/s
  /// Wheel speed below which the brakes' friction fades to nothing, rad/s: a held brake lets the
  /// car come to rest exponentially, within 5 ms at the friction limit.
  double brake_speed = 0.1;

  void validate() const;
};

/// States: x, y of the centre of gravity (m), yaw (rad), longitudinal and lateral velocity in the
/// car's frame (m/s), yaw rate (rad/s), steering angle (rad), angular speeds of front and rear
/// wheels (rad/s). Load moves with the actual acceleration, at once. The rear wheels drive, brakes
/// act by load. Engine and brakes ease off where slip along the wheel passes s_max (ideal traction
/// control and anti-lock), so a commanded -mu g brakes at the friction limit and stays steerable.
/// Brakes hold: negative acceleration at rest does nothing. No reverse gear, no drag.
std::shared_ptr<const VehicleModel> make_car(const CarParameters& parameters = {});

}  // namespace blindcorner
