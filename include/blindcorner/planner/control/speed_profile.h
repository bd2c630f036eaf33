// SPDX-License-Identifier: Apache-2.0
/// How fast a vehicle can drive a path.
#pragma once

#include <span>
#include <vector>

#include "blindcorner/planner/path/path.h"
#include "blindcorner/planner/vehicles/vehicle_state.h"

namespace blindcorner {

struct SpeedProfileOptions {
  double speed = 10;  ///< wanted along the path, m/s
  double start = 0;   ///< speed at the path's start, m/s; if it is too high to be braked in time,
                      ///< braking starts at once
  double end = 0;     ///< speed at the path's end, m/s
  /// Shares of the vehicle's friction limit (mu g) that a plan uses; the rest is left for control.
  double cornering = 0.9;  ///< lateral: v^2 |curvature| <= cornering mu g; infinite: curves are
                           ///< taken at any speed
  double braking = 0.5;    ///< comfortable, less than a safe stop has
  double driving = 0.3;    ///< also at most VehicleLimits::acceleration
  /// [samples] further limits, m/s (safe_speed.h), possibly infinite; empty: no further limits.
  std::vector<double> limits = {};

  void validate() const;
};

/// Largest speeds at the samples, m/s. Each is at most the wanted speed, the speed that the
/// curvature allows, and the speeds that braking and driving inside the friction circle can reach
/// from its neighbours (one pass backwards, one forwards). Between samples v^2 is linear in arc
/// length.
std::vector<double> speed_profile(std::span<const PathPoint> path, const VehicleLimits& limits,
                                  const SpeedProfileOptions& options = {});

}  // namespace blindcorner
