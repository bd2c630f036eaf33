// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/control/predicted_contact.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

/// A vehicle that brakes and is slower than this, m/s, stands.
constexpr double kStands = 0.05;
/// Depths of overlap that differ by less, m, are the same.
constexpr double kDeeper = 0.01;

/// How deep the vehicle is in obstacles, m: 0 where it touches none.
double overlap(const PlanningGrid& grid, const VehicleFootprint& body, const VehicleState& state) {
  const double radius = body.disc_radius();
  double deepest = 0;
  for (const double offset : body.disc_offsets()) {
    const Eigen::Vector2d center =
        state.position + offset * Eigen::Vector2d(std::cos(state.yaw), std::sin(state.yaw));
    const auto nearest = grid.nearest_obstacle(center, radius);
    if (nearest) deepest = std::max(deepest, radius - (*nearest - center).norm());
  }
  return deepest;
}

}  // namespace

void PredictionOptions::validate() const {
  const auto positive = [](const char* field, double value) {
    if (value > 0 && std::isfinite(value)) return;
    throw Error("PredictionOptions." + std::string(field) + " = " + std::to_string(value) +
                "; accepted: a number > 0");
  };
  positive("period", period);
  positive("distance", distance);
  positive("time_limit", time_limit);
}

std::optional<double> predicted_contact(Vehicle vehicle, PathFollower follower,
                                        const PlanningGrid& grid, const VehicleFootprint& body,
                                        const PredictionOptions& options) {
  options.validate();
  VehicleState state = vehicle.state();
  double allowed = overlap(grid, body, state);
  double driven = 0;
  for (double time = 0; time < options.time_limit && driven < options.distance;
       time += options.period) {
    const FollowerOutput output = follower.follow(state);
    if (std::abs(state.speed) < kStands && output.request.acceleration <= 0) break;
    vehicle.step(output.request, options.period);
    const VehicleState next = vehicle.state();
    driven += (next.position - state.position).norm();
    const double depth = overlap(grid, body, next);
    if (depth > allowed + kDeeper) return output.arc_length;
    allowed = std::min(allowed, depth);
    state = next;
  }
  return std::nullopt;
}

}  // namespace blindcorner
