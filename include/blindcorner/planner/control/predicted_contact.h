// SPDX-License-Identifier: Apache-2.0
/// Where a vehicle that follows a path will really go, and what it touches there.
#pragma once

#include <optional>

#include "blindcorner/planner/control/path_follower.h"
#include "blindcorner/planner/path/planning_grid.h"
#include "blindcorner/planner/vehicles/vehicle.h"

namespace blindcorner {

struct PredictionOptions {
  double period = 0.05;   ///< s, control period of the prediction
  double distance = 15;   ///< m that the prediction drives, from the vehicle's place
  double time_limit = 5;  ///< s of driving after which the prediction ends

  /// Throws Error naming the field.
  void validate() const;
};

/// Arc length on the follower's path at which its vehicle will touch an obstacle of the grid, m;
/// nullopt if it will not. The path may be free where the vehicle is not: a path that turns faster
/// than the steering can leaves the vehicle on the outside of the turn. Therefore copies of the
/// vehicle and the follower drive on. The vehicle moves by its own equations and obeys the
/// follower, until it stands still, has driven `distance`, or has driven for `time_limit`. A
/// vehicle that turns on the spot counts as standing still. The answer is rounded back to the place
/// of the step before. The outside of the grid is free, unless the grid's border is closed. A disc
/// of the body that is in an obstacle at the start may leave the obstacle, but must not go deeper
/// into it (depth is measured up to the disc's centre).
std::optional<double> predicted_contact(Vehicle vehicle, PathFollower follower,
                                        const PlanningGrid& grid, const VehicleFootprint& body,
                                        const PredictionOptions& options = {});

}  // namespace blindcorner
