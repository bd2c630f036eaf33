// SPDX-License-Identifier: Apache-2.0
/// The ground that a vehicle covers, as discs along its long axis.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace blindcorner {

/// Pose of a vehicle: position of its reference point, and its heading.
struct PlanarPose {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  ///< m, world
  double heading = 0;                                  ///< rad, 0 along +x, counter-clockwise
};

/// Discs of equal radius with their centres on the vehicle's long axis. Together they cover the
/// vehicle and reach beyond its sides by at most a tenth of its half width.
class VehicleFootprint {
 public:
  /// A point; it collides where its cell is blocked.
  VehicleFootprint() = default;
  /// `radius` >= 0, m. Throws Error otherwise.
  static VehicleFootprint disc(double radius);
  /// A rectangle, m. Its centre is `center_ahead` m ahead of the reference point (negative:
  /// behind), and the reference point is `rear_axle` m ahead of the wheels that do not steer.
  /// Throws Error unless length and width are > 0, `rear_axle` is >= 0 and all are finite.
  static VehicleFootprint rectangle(double length, double width, double center_ahead = 0,
                                    double rear_axle = 0);

  double disc_radius() const { return disc_radius_; }                   ///< m
  const std::vector<double>& disc_offsets() const { return offsets_; }  ///< m ahead
  /// Radius of the largest disc about the reference point that is inside the vehicle at any
  /// heading, m.
  double inscribed_radius() const { return inscribed_radius_; }
  /// Radius of the smallest disc about the reference point that contains all the footprint's discs,
  /// m.
  double circumscribed_radius() const { return circumscribed_radius_; }
  double rear_axle() const { return rear_axle_; }  ///< m behind the reference point

 private:
  std::vector<double> offsets_{0.0};
  double disc_radius_ = 0;
  double inscribed_radius_ = 0;
  double circumscribed_radius_ = 0;
  double rear_axle_ = 0;
};

/// Whether the distance between two bodies, each at its pose, is less than a margin, m.
bool touch(const VehicleFootprint& a, const PlanarPose& at_a, const VehicleFootprint& b,
           const PlanarPose& at_b, double margin);

}  // namespace blindcorner
