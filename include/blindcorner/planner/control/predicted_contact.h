// SPDX-License-Identifier: Apache-2.0
/// Where a vehicle that follows a path will really go, and what it touches there.
#pragma once

#include <optional>

#include "blindcorner/planner/control/path_follower.h"
#include "blindcorner/planner/path/planning_grid.h"
#include "blindcorner/planner/vehicles/vehicle.h"

namespace blindcorner {

struct PredictionOptions {
  double period = 0.05;   ///< s, of the predicted control
  double distance = 15;   ///< m that are driven ahead, from where the vehicle is
  double time_limit = 5;  ///< s of driving after which nothing more is predicted

  /// Throws Error naming the field.
  void validate() const;
};

/// Arc length of the follower's path at which its vehicle will touch an obstacle of the grid, m;
/// none where it will not. The path may be free where its vehicle is not: one that turns more
/// quickly than the steering can is left on the outside of the turn. So copies of both drive on,
/// the vehicle by its own equations and as the follower tells it, until it stays where it is or has
/// driven `distance`, or for `time_limit`. A vehicle that turns on the spot stays where it is. The
/// answer is rounded backwards to the place of the step before. What is beside the grid is free. A
/// disc of the body that is in an obstacle from the start on may leave it, but not go deeper (than
/// to its centre).
std::optional<double> predicted_contact(Vehicle vehicle, PathFollower follower,
                                        const PlanningGrid& grid, const VehicleFootprint& body,
                                        const PredictionOptions& options = {});

}  // namespace blindcorner
