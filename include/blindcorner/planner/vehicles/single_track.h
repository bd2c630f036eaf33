// SPDX-License-Identifier: Apache-2.0
/// Single track with linear tyres (CommonRoad's ST).
#pragma once

#include <memory>

#include "blindcorner/planner/vehicles/single_track_parameters.h"
#include "blindcorner/planner/vehicles/vehicle_model.h"

namespace blindcorner {

struct SingleTrackTyres {
  double friction = 1.0489;                 ///< mu, the lateral peak of CommonRoad's tyre
  double front_stiffness = 21.92 / 1.0489;  ///< lateral force / (mu load slip angle), 1/rad
  double rear_stiffness = 21.92 / 1.0489;   ///< the same, 1/rad
  double kinematic_below = 0.1;             ///< |speed| below which wheels do not slip, m/s
};

/// States: x, y of the centre of gravity (m), steering angle (rad), speed (m/s), yaw (rad), yaw
/// rate (rad/s), slip angle (rad). Tyre forces grow without bound with slip (no friction circle),
/// load moves with the commanded acceleration. The derivatives jump where the speed crosses
/// `kinematic_below`: below, yaw rate and slip angle follow from the steering angle's rate, and
/// whatever they were at the crossing stays as an offset. Not for reversing: beyond
/// -kinematic_below these equations are unstable (slip angles take the speed's sign) and grow
/// without bound.
std::shared_ptr<const VehicleModel> make_single_track(const SingleTrackParameters& parameters = {},
                                                      const SingleTrackTyres& tyres = {});

}  // namespace blindcorner
