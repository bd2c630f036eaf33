// SPDX-License-Identifier: Apache-2.0
/// Single track with spinning wheels and Pacejka's tyres (CommonRoad's STD).
#pragma once

#include <memory>

#include "blindcorner/planner/vehicles/single_track_parameters.h"
#include "blindcorner/planner/vehicles/vehicle_model.h"

namespace blindcorner {

/// Pacejka's tyre, "Tyre and Vehicle Dynamics" (2012), section 4.3.2, without camber. Defaults:
/// table 7 of Althoff and Wuersching (2020). Names of the coefficients as there.
struct PacejkaTyre {
  double p_cx1 = 1.6411, p_dx1 = 1.1739, p_ex1 = 0.46403, p_kx1 = 22.303;
  double p_hx1 = 0.0012297, p_vx1 = -8.8098e-06;
  double r_bx1 = 13.276, r_bx2 = -13.778, r_cx1 = 1.2568, r_ex1 = 0.65225, r_hx1 = 0.0050722;
  double p_cy1 = 1.3507, p_dy1 = 1.0489, p_ey1 = -0.0074722, p_ky1 = -21.92;
  double r_by1 = 7.1433, r_by2 = 9.1916, r_by3 = -0.027856;
  double r_cy1 = 1.0719, r_ey1 = -0.27572, r_hy1 = 5.7448e-06;
  double r_vy1 = -0.027825, r_vy4 = 12.12, r_vy5 = 1.9, r_vy6 = -10.704;
};

/// States: x, y of the centre of gravity (m), steering angle (rad), speed (m/s), yaw (rad), yaw
/// rate (rad/s), slip angle (rad), angular speeds of front and rear wheels (rad/s, >= 0).
/// Fades into the kinematic model around 0.2 m/s. Not for standing: the faded tyre force of the
/// standing wheels pushes the car backwards by 3 mm/s^2, and a brake that is held drives it
/// backwards with the kinematic model. The product's car has neither flaw.
std::shared_ptr<const VehicleModel> make_single_track_drift(
    const SingleTrackParameters& parameters = {}, const PacejkaTyre& tyre = {});

}  // namespace blindcorner
