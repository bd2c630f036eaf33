// SPDX-License-Identifier: Apache-2.0
/// The planner as a whole: occupancy probabilities in, a path out.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>

#include "blindcorner/planner/path/curve_limits.h"
#include "blindcorner/planner/path/grid_search.h"
#include "blindcorner/planner/path/mover.h"
#include "blindcorner/planner/path/path.h"
#include "blindcorner/planner/path/planning_grid.h"
#include "blindcorner/planner/path/vehicle_footprint.h"

namespace blindcorner {

struct PathPlannerOptions {
  PlanningGridOptions grid;  ///< radii of 0 are taken from the footprint
  GridSearchOptions search;
  VehicleFootprint footprint;
  CurveLimits curves;  ///< a turning radius of 0: paths have corners, and the vehicle turns there
  /// Whether a vehicle whose curves have a radius can turn on the spot before it drives off.
  bool turns_on_the_spot = false;
  double point_spacing = 0.5;  ///< m between points of a path, at most

  /// A car of 4.5 x 1.8 m that turns in 5.5 m, and a round robot of radius 0.1 m.
  static PathPlannerOptions car();
  static PathPlannerOptions robot();
  /// Throws Error naming the field.
  void validate() const;
};

struct PathRequest {
  Eigen::Vector2d start = Eigen::Vector2d::Zero();  ///< m
  std::optional<double> start_heading;  ///< rad, where the vehicle points; none: anywhere
  PathGoal goal;
  double start_curvature = 0;  ///< 1/m, left is positive; counts where `start_heading` is given
  double speed = 0;            ///< m/s, at the start
  std::span<const Mover> movers = {};  ///< that the path keeps away from
};

/// Plans what the vehicle can drive, or nothing: every step of the search is one that it can drive
/// and that touches nothing (planner/path/drivable_search.h; of what turns on the spot
/// planner/path/turning_path.h). Can be moved, but not copied; one that was moved from must not
/// plan.
class PathPlanner {
 public:
  explicit PathPlanner(const PathPlannerOptions& options = {});
  ~PathPlanner();
  PathPlanner(PathPlanner&&) noexcept;
  PathPlanner& operator=(PathPlanner&&) noexcept;

  const PathPlannerOptions& options() const { return options_; }
  /// A grid as this planner's options want it. Throws Error as PlanningGrid does.
  PlanningGrid grid(const GridGeometry& geometry, std::span<const double> occupancy) const;
  /// `grid` as `grid()` makes it. Paths that are not there are told by the status; throws Error
  /// only for coordinates and curvatures that are not numbers, and for a goal that is a line where
  /// there is no turning radius. Thread safe.
  Path plan(const PlanningGrid& grid, const PathRequest& request) const;

 private:
  class Searches;

  PathPlannerOptions options_;
  std::unique_ptr<Searches> searches_;
};

}  // namespace blindcorner
