// SPDX-License-Identifier: Apache-2.0
/// The robot: two driven wheels on one axle.
#pragma once

#include <memory>

#include "blindcorner/planner/vehicles/vehicle_model.h"

namespace blindcorner {

/// The published robot is not described. Defaults: a base about the size of an iRobot Create 3.
/// Speed and acceleration are the smallest round figures with which the robot drives the published
/// 1.4 m in 1.3 s from standstill: 0.75 s and 0.56 m to reach 1.5 m/s at 2 m/s^2, then 0.56 s.
struct DifferentialDriveParameters {
  double length = 0.30, width = 0.30;  ///< m
  double axle_to_center = 0;           ///< from the axle forwards to the footprint's centre, m
  double track = 0.233;                ///< between the wheels, m
  double wheel_speed = 1.5;            ///< largest speed of a rim, m/s
  double acceleration = 2.0;           ///< largest acceleration of either wheel's rim, m/s^2
  double friction = 0.9;               ///< mu; only used for the limits that controllers read

  void validate() const;
};

/// States: x, y of the axle's middle (m), yaw (rad), speeds of left and right wheel's rim (m/s).
/// The wheels do not slip. A request's curvature becomes a yaw rate at a speed of at least 0.2 m/s,
/// so that the robot can also turn on the spot.
std::shared_ptr<const VehicleModel> make_differential_drive(
    const DifferentialDriveParameters& parameters = {});

}  // namespace blindcorner
