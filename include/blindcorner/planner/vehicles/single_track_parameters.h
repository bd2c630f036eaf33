// SPDX-License-Identifier: Apache-2.0
/// Dimensions of a car as a single track.
#pragma once

namespace blindcorner {

inline constexpr double kGravity = 9.81;  ///< m/s^2, as in the CommonRoad models

/// Defaults: BMW 320i, vehicle 2 of Althoff and Wuersching, "CommonRoad: Vehicle Models" (2020),
/// table 6, as in release 3.0.2 of its package.
struct SingleTrackParameters {
  double length = 4.508, width = 1.610;       ///< m
  double mass = 1093.2952334674046;           ///< kg
  double yaw_inertia = 1791.5995300122856;    ///< kg m^2
  double front_axle = 1.1561957064;           ///< from the centre of gravity, m
  double rear_axle = 1.4227170936;            ///< from the centre of gravity, m
  double gravity_center_height = 0.61373004;  ///< of the sprung mass, as the models use it, m
  double wheel_inertia = 1.7;                 ///< of an axle's wheels, kg m^2
  double wheel_radius = 0.344;                ///< m
  double front_drive_share = 0;               ///< of the engine's torque; 0: the rear wheels drive
  double steering_angle = 1.066;              ///< largest, rad
  double steering_rate = 0.4;                 ///< largest, rad/s
  double acceleration = 11.5;                 ///< largest, m/s^2
  double full_power_speed = 7.319;            ///< above it power, not torque, limits the drive, m/s
  double speed_min = -13.9, speed_max = 50.8;  ///< m/s

  double wheelbase() const { return front_axle + rear_axle; }
  /// Throws Error naming the field.
  void validate() const;
};

}  // namespace blindcorner
