// SPDX-License-Identifier: Apache-2.0
/// The car of the drives: single-track model with wheel slip and friction circle, also at
/// standstill.
#pragma once

#include <memory>

#include "blindcorner/planner/vehicles/single_track_parameters.h"
#include "blindcorner/planner/vehicles/vehicle_model.h"

namespace blindcorner {

/// Tyres follow Pacejka's isotropic brush model ("Tyre and Vehicle Dynamics" (2012), section 3.2):
///   slip  s = (R w - u, -v) / sqrt((R w)^2 + e^2)   (u, v: hub's velocity, wheel's frame)
///   force F = mu load (1 - (1 - |s|/s_max)^3) s/|s|,
///         F = mu load s/|s| from s_max = 3 mu/stiffness on
/// Force and slip are therefore parallel, no force exceeds the friction circle, and no force does
/// work on the car. e keeps the slip finite at rest, where the tyre acts as a damper. It lowers the
/// slip stiffness by the factor |R w| / sqrt((R w)^2 + e^2), that is by e^2 / (2 (R w)^2), 0.5 % at
/// 1 m/s.
struct CarParameters {
  SingleTrackParameters body{.length = 4.5, .width = 1.8};  ///< dimensions of the published street
  double friction = 0.9;                                    ///< mu, published
  double slip_stiffness = 21.92;  ///< force / (load slip): -p_ky1 of CommonRoad's tyre
  double slip_speed = 0.1;        ///< e, m/s
  /// Wheel speed below which the brakes' friction fades to zero, rad/s: with held brakes the car
  /// comes to rest exponentially, within 5 ms at the friction limit.
  double brake_speed = 0.1;

  void validate() const;
};

/// States: x, y of the centre of gravity (m), yaw (rad), longitudinal and lateral velocity in the
/// car's frame (m/s), yaw rate (rad/s), steering angle (rad), angular speeds of front and rear
/// wheels (rad/s). The load moves with the actual acceleration, at once. The rear wheels drive, and
/// the brakes act in proportion to the load. Engine and brakes ease off where the slip along the
/// wheel exceeds s_max (ideal traction control and anti-lock), so that a commanded -mu g brakes at
/// the friction limit and the car stays steerable. Brakes hold: a negative acceleration at rest has
/// no effect. The car has no reverse gear and no drag.
std::shared_ptr<const VehicleModel> make_car(const CarParameters& parameters = {});

}  // namespace blindcorner
