// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/control/predicted_contact.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "planner/require_positive.h"

namespace blindcorner {
namespace {

/// A vehicle that brakes and is slower than this, m/s, stays where it is.
constexpr double kStays = 0.05;
/// Depths of overlap that differ by less than this, m, count as the same.
constexpr double kDeeper = 0.01;

}  // namespace

void PredictionOptions::validate() const {
  require_positive("PredictionOptions", "period", period);
  require_positive("PredictionOptions", "distance", distance);
  require_positive("PredictionOptions", "time_limit", time_limit);
}

std::optional<double> predicted_contact(Vehicle vehicle, PathFollower follower,
                                        const PlanningGrid& grid, const VehicleFootprint& body,
                                        const PredictionOptions& options) {
  options.validate();
  VehicleState state = vehicle.state();
  std::vector<double> allowed = grid.overlaps(body, {state.position, state.yaw});
  double driven = 0;
  for (double time = 0; time < options.time_limit && driven < options.distance;
       time += options.period) {
    const FollowerOutput output = follower.follow(state);
    if (std::abs(state.speed) < kStays && output.request.acceleration <= 0) break;
    vehicle.step(output.request, options.period);
    const VehicleState next = vehicle.state();
    driven += (next.position - state.position).norm();
    const std::vector<double> depths = grid.overlaps(body, {next.position, next.yaw});
    for (std::size_t disc = 0; disc < depths.size(); ++disc) {
      if (depths[disc] > allowed[disc] + kDeeper) return output.arc_length;
      allowed[disc] = std::min(allowed[disc], depths[disc]);
    }
    state = next;
  }
  return std::nullopt;
}

}  // namespace blindcorner
