// SPDX-License-Identifier: Apache-2.0
/// The interface between a vehicle and other parts: motion, limits, commands and requests.
#pragma once

#include <Eigen/Geometry>
#include <limits>

#include "blindcorner/forward/scene/pose.h"

namespace blindcorner {

/// Motion of a vehicle's reference point in the plane. The reference point is a single track's
/// centre of gravity (of the kinematic single track the rear axle), or the middle of the robot's
/// axle.
struct VehicleState {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  ///< m
  double yaw = 0;             ///< rad, not wrapped; 0 looks along +x, counter-clockwise
  double speed = 0;           ///< m/s, along yaw + slip_angle; negative: backwards
  double steering_angle = 0;  ///< of the front wheels, rad; 0 for a robot
  double yaw_rate = 0;        ///< rad/s
  double slip_angle = 0;      ///< from the vehicle's long axis to its course, rad

  /// Direction of motion, rad.
  double course() const { return yaw + slip_angle; }
};

/// The vehicle's frame in the world: origin at its reference point on the floor, x forwards, y to
/// the left, z up. A sensor's mount is a fixed transform T_vehicle_sensor, and
/// T_world_sensor = T_world_vehicle(state) * T_vehicle_sensor.
Transform T_world_vehicle(const VehicleState& state);

/// Rectangle that the vehicle covers, with its long side along the vehicle's x.
struct VehicleRectangle {
  double length = 0, width = 0;  ///< m
  double center_x = 0;           ///< of the rectangle in the vehicle's frame (its y is 0), m
  double rear_axle = 0;  ///< m, from the reference point back to the wheels that do not steer
};

/// Yaw of a vehicle whose reference point is a distance r ahead of the rear axle and moves in
/// direction `course` (rad) along a curvature k (1/m). Rear wheels only roll forwards. Therefore
/// the reference point's speed along the vehicle is v cos(b). Its speed across the vehicle is the
/// yaw rate times r, v k r = v sin(b). This gives yaw = course - b, sin(b) = k r. In a turn to the
/// left the front is outside the path. Tyres that slip turn the vehicle back by a / (g C), where a
/// is the lateral acceleration and C the tyres' stiffness, and by half as much again near the
/// friction limit. At 0.7 of that limit these effects are 0.04 rad, and the car's corners are off
/// by 9 cm.
double yaw_on_path(double course, double curvature, double rear_axle);

/// Limits that a vehicle cannot exceed; controllers and planners stay below them.
struct VehicleLimits {
  double speed = 0;         ///< m/s
  double acceleration = 0;  ///< of the drive, m/s^2
  double friction = 0;  ///< mu g, m/s^2: bounds braking and the acceleration's norm in the plane
  double curvature = std::numeric_limits<double>::infinity();      ///< of the path, 1/m
  double steering_rate = std::numeric_limits<double>::infinity();  ///< rad/s
  double wheelbase = 0;  ///< front to rear axle, m; 0: turns on the spot
};

/// Settings of the actuators, held during a step. Vehicles clip them to their own limits.
struct VehicleCommand {
  double acceleration = 0;  ///< m/s^2; negative: brakes; the robot also drives backwards
  double steering = 0;      ///< rate of the steering angle, rad/s; of the robot's yaw rate, rad/s^2
};

/// A controller's request to any vehicle; VehicleModel::command() turns it into settings.
struct DriveRequest {
  double acceleration = 0;  ///< along the path, m/s^2
  double curvature = 0;     ///< of the path, 1/m; to the left is positive
};

}  // namespace blindcorner
