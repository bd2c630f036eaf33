// SPDX-License-Identifier: Apache-2.0
/// How the hidden object may move between the frames of a sequence.
#pragma once

namespace blindcorner {

/// Motion model, read from the field `motion` of a scene file. Velocity along x and y is nearly
/// constant; everything else walks at random.
struct Motion {
  double frame_interval = 0.1;  ///< s, from one frame to the next
  /// Spectral density of the acceleration of x and y, m^2/s^3. An acceleration of standard
  /// deviation s that lasts for a time tau has the density 2 s^2 tau.
  double acceleration_density = 1.0;
  double initial_speed = 1.0;     ///< m/s, standard deviation along x and y at first sight
  double height_drift = 0.02;     ///< m/sqrt(s), of z
  double yaw_drift = 1.0;         ///< rad/sqrt(s)
  double size_drift = 0.01;       ///< 1/sqrt(s)
  double brightness_drift = 0.1;  ///< 1/sqrt(s), of the amplitude's natural logarithm
  /// Standard deviation, per axis, of the real object's position about the position where the
  /// model's shape explains its light best, m. The error is the same from frame to frame, so no
  /// number of frames averages it out. It is added to the reported covariances.
  double position_error = 0.0;
};

}  // namespace blindcorner
