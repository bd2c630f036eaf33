// SPDX-License-Identifier: Apache-2.0
/// What moves over the ground, and where it will be.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>

#include "blindcorner/planner/path/vehicle_footprint.h"

namespace blindcorner {

/// Something that moves, as far as it is known. Its pose p and velocity v are normal distributions;
/// at a time t it is at p + v t + w, with w the random walk of its velocity, of variance q t^3 / 3.
struct Mover {
  std::string name;
  VehicleFootprint body;                                 ///< about its position
  PlanarPose pose;                                       ///< mean, now
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();    ///< mean, m/s
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();  ///< of x, y (m), and their velocities
  double acceleration_density = 0;                       ///< q, m^2/s^3 (Motion)
  double probability = 1;                                ///< that it is there, and is this one

  PlanarPose at(double time) const;    ///< mean pose at a time, s
  double sigma_at(double time) const;  ///< m, greatest standard deviation of the position then
};

/// Movers that a path keeps away from, where it can, and how the vehicle meets them.
struct MoverAvoidance {
  std::span<const Mover> movers;
  double speed = 0;  ///< m/s, of the vehicle, as if it held it

  /// Whether the vehicle at a pose, `distance` m from where it is now, is where a mover is expected
  /// by then: one that is likelier than not to be avoided as a cell of a map is, with a margin of
  /// its standard deviation. What is more than a few seconds ahead is not looked at, nor what the
  /// vehicle is in already.
  bool meets(const VehicleFootprint& body, const PlanarPose& pose, double distance,
             const PlanarPose& now) const;
};

}  // namespace blindcorner
