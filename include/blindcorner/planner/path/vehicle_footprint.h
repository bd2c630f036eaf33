// SPDX-License-Identifier: Apache-2.0
/// The ground that a vehicle covers, as discs along its long axis.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace blindcorner {

/// Where a vehicle stands: position of its reference point, and the direction that it points in.
struct PlanarPose {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  ///< m, world
  double heading = 0;                                  ///< rad, 0 along +x, counter-clockwise
};

/// Discs of one radius whose centres lie on the vehicle's long axis. Together they cover the
/// vehicle, and reach beyond its sides by at most a tenth of its half width.
class VehicleFootprint {
 public:
  /// A point, which collides where its cell is blocked.
  VehicleFootprint() = default;
  /// `radius` >= 0, m. Throws Error otherwise.
  static VehicleFootprint disc(double radius);
  /// A rectangle, m, its centre `center_ahead` m before the reference point (negative: behind),
  /// which is `rear_axle` m before the wheels that do not steer. Throws Error unless length and
  /// width are > 0.
  static VehicleFootprint rectangle(double length, double width, double center_ahead = 0,
                                    double rear_axle = 0);

  double disc_radius() const { return disc_radius_; }                   ///< m
  const std::vector<double>& disc_offsets() const { return offsets_; }  ///< m ahead
  /// Largest disc about the reference point that is inside the vehicle at any heading, m.
  double inscribed_radius() const { return inscribed_radius_; }
  /// Smallest disc about the reference point that holds all the footprint's discs, m.
  double circumscribed_radius() const { return circumscribed_radius_; }
  double rear_axle() const { return rear_axle_; }  ///< m behind the reference point

 private:
  std::vector<double> offsets_{0.0};
  double disc_radius_ = 0;
  double inscribed_radius_ = 0;
  double circumscribed_radius_ = 0;
  double rear_axle_ = 0;
};

/// Whether two bodies, each at its pose, come nearer to each other than a margin, m.
bool touch(const VehicleFootprint& a, const PlanarPose& at_a, const VehicleFootprint& b,
           const PlanarPose& at_b, double margin);

}  // namespace blindcorner
