// SPDX-License-Identifier: Apache-2.0
/// How tightly a vehicle can turn along a path, and how quickly into a turn.
#pragma once

#include <limits>

namespace blindcorner {

/// A vehicle that begins a path at speed v0 can have slowed down to v(s) = sqrt(v0^2 - 2 b s) at
/// arc length s. There it can turn with a curvature of 1/R and of a / v^2 at most, and its
/// curvature changes by at most w / v per metre. A path within these limits is one that the
/// vehicle can drive, if it slows down for curves as `braking` says.
struct CurveLimits {
  double turning_radius = 0;  ///< R, m, of a vehicle that creeps
  double lateral_acceleration = std::numeric_limits<double>::infinity();  ///< a, m/s^2
  /// w, 1/(m s): steering rate over wheelbase.
  double curvature_speed = std::numeric_limits<double>::infinity();
  double braking = 0;  ///< b, m/s^2; 0: the vehicle holds its speed
  /// m/s: what is slower costs time. 0: time is not looked at.
  double wanted_speed = 0;

  /// v(s), m/s, for a start at `start_speed`; at least `kCreeping` of the wanted speed.
  double speed(double start_speed, double arc_length) const;
  double curvature(double speed) const;       ///< 1/m, the greatest at a speed (m/s)
  double curvature_rate(double speed) const;  ///< 1/m^2, likewise
  /// Time that a metre takes, over that at the wanted speed, where the curvature (1/m) and its rate
  /// (1/m^2) allow no more; 1 at least.
  double slowness(double curvature, double rate) const;

  /// No path is planned for less than this share of the wanted speed: a car's walking pace.
  static constexpr double kCreeping = 0.2;

  /// Throws Error naming the field.
  void validate() const;
};

}  // namespace blindcorner
