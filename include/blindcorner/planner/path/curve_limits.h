// SPDX-License-Identifier: Apache-2.0
/// How tightly a vehicle can turn along a path, and how quickly it can start a turn.
#pragma once

#include <limits>

namespace blindcorner {

/// A vehicle that begins a path at speed v0 can slow down to v(s) = sqrt(v0^2 - 2 b s) by arc
/// length s. There its curvature can be at most 1/R and at most a / v^2, and its curvature changes
/// by at most w / v per metre. A vehicle can drive a path within these limits if it slows down for
/// curves as `braking` says.
struct CurveLimits {
  double turning_radius = 0;                                              ///< R, m, at walking pace
  double lateral_acceleration = std::numeric_limits<double>::infinity();  ///< a, m/s^2
  /// w, 1/(m s): steering rate over wheelbase.
  double curvature_speed = std::numeric_limits<double>::infinity();
  double braking = 0;  ///< b, m/s^2; 0: the vehicle holds its speed
  /// m/s: lower speeds cost time. 0: time is ignored.
  double wanted_speed = 0;

  /// v(s), m/s, for a start at `start_speed`; at least `kCreeping` of the wanted speed.
  double speed(double start_speed, double arc_length) const;
  double curvature(double speed) const;       ///< 1/m, greatest curvature at a speed (m/s)
  double curvature_rate(double speed) const;  ///< 1/m^2, greatest rate of the curvature
  /// Time per metre divided by the time per metre at the wanted speed, where the curvature (1/m)
  /// and its rate (1/m^2) allow no more; at least 1.
  double slowness(double curvature, double rate) const;

  /// Plans never assume less than this share of the wanted speed: a car's walking pace.
  static constexpr double kCreeping = 0.2;

  /// Throws Error naming the field.
  void validate() const;
};

}  // namespace blindcorner
