// SPDX-License-Identifier: Apache-2.0
/// The whole planner: occupancy probabilities in, a path out.
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
  CurveLimits curves;  ///< turning radius 0: paths have corners; the vehicle turns there
  /// Whether a vehicle whose curves have a radius can turn on the spot before it starts to drive.
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
  std::optional<double> start_heading;  ///< rad, the vehicle's heading; empty: any heading
  PathGoal goal;
  double start_curvature = 0;  ///< 1/m, positive to the left; used where `start_heading` is given
  double speed = 0;            ///< m/s, at the start
  std::span<const Mover> movers = {};  ///< movers that the path avoids
};

/// Plans a path that the vehicle can drive, or none: the vehicle can drive every step of the search
/// without touching anything (planner/path/drivable_search.h; for vehicles that turn on the spot
/// planner/path/turning_path.h). The planner can be moved but not copied; a moved-from planner must
/// not plan.
class PathPlanner {
 public:
  explicit PathPlanner(const PathPlannerOptions& options = {});
  ~PathPlanner();
  PathPlanner(PathPlanner&&) noexcept;
  PathPlanner& operator=(PathPlanner&&) noexcept;

  const PathPlannerOptions& options() const { return options_; }
  /// A grid with this planner's options. Throws Error as PlanningGrid does.
  PlanningGrid grid(const GridGeometry& geometry, std::span<const double> occupancy) const;
  /// `grid` is made by `grid()`. The status tells why there is no path. Throws Error only for
  /// coordinates, headings, curvatures and speeds that are not numbers, and for a goal line if the
  /// turning radius is 0. Thread safe.
  Path plan(const PlanningGrid& grid, const PathRequest& request) const;

 private:
  class Searches;

  PathPlannerOptions options_;
  std::unique_ptr<Searches> searches_;
};

}  // namespace blindcorner
