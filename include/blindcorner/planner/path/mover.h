// SPDX-License-Identifier: Apache-2.0
/// Objects that move over the ground, and where they will be.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>

#include "blindcorner/planner/path/vehicle_footprint.h"

namespace blindcorner {

/// A moving object, as far as it is known. Its pose p and velocity v are normal distributions. At a
/// time t it is at p + v t + w, where w comes from the random walk of its velocity and has variance
/// q t^3 / 3.
struct Mover {
  std::string name;
  VehicleFootprint body;                                 ///< outline about the object's position
  PlanarPose pose;                                       ///< mean, now
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();    ///< mean, m/s
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();  ///< of x, y (m) and their velocities (m/s)
  double acceleration_density = 0;                       ///< q, m^2/s^3 (Motion)
  double probability = 1;                                ///< that the object exists and is this one

  PlanarPose at(double time) const;    ///< mean pose at a time, s
  double sigma_at(double time) const;  ///< m, greatest standard deviation of the position then
};

/// Movers that a path avoids where it can, and how the vehicle meets them.
struct MoverAvoidance {
  std::span<const Mover> movers;
  double speed = 0;  ///< m/s, of the vehicle, taken as constant

  /// Whether the vehicle at a pose, `distance` m from its present place, meets a mover that is
  /// expected there by then. Movers with a probability below 0.2 are left to braking. The margin is
  /// 0.3 m plus the standard deviation of the mover's position (at most 1 m). Places more than 4 s
  /// ahead are ignored, and so are movers that the vehicle touches already. A vehicle slower than
  /// 1 m/s meets no mover.
  bool meets(const VehicleFootprint& body, const PlanarPose& pose, double distance,
             const PlanarPose& now) const;
};

}  // namespace blindcorner
