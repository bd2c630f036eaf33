// SPDX-License-Identifier: Apache-2.0
/// The planner as a whole: occupancy probabilities in, a path out.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>

#include "blindcorner/planner/path/grid_search.h"
#include "blindcorner/planner/path/path.h"
#include "blindcorner/planner/path/planning_grid.h"
#include "blindcorner/planner/path/smoothing.h"

namespace blindcorner {

struct PathPlannerOptions {
  PlanningGridOptions grid;  ///< radii of 0 are taken from the footprint
  GridSearchOptions search;
  SmoothingOptions smoothing;

  /// A car of 4.5 x 1.8 m that turns in 5.5 m, and a round robot of radius 0.1 m.
  static PathPlannerOptions car();
  static PathPlannerOptions robot();
  /// Throws Error naming the field.
  void validate() const;
};

struct PathRequest {
  Eigen::Vector2d start = Eigen::Vector2d::Zero();  ///< m
  std::optional<double> start_heading;              ///< rad; none: any
  Eigen::Vector2d goal = Eigen::Vector2d::Zero();   ///< m
  std::optional<double> goal_heading;               ///< rad; none: any
  double start_curvature = 0;  ///< 1/m, left is positive; counts where `start_heading` is given
};

/// Search, shortcuts, smoothing. Where the vehicle does not fit around a corner of the path that
/// its narrow side allows, the search is made again with room for every heading; where it cannot
/// drive what is found either, on the other sides of the obstacles that stand alone. These further
/// attempts go on side by side; what comes of them does not depend on how many at a time. Can be
/// moved, but not copied; one that was moved from must not plan.
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
  /// only for coordinates and curvatures that are not numbers. Thread safe.
  Path plan(const PlanningGrid& grid, const PathRequest& request) const;

 private:
  class Searches;
  Path plan_on_all_sides(const PlanningGrid& grid, const PathRequest& request) const;
  Path plan_with_room(const PlanningGrid& grid, const PathRequest& request) const;
  Path plan_once(const PlanningGrid& grid, const PathRequest& request,
                 std::span<const Eigen::Vector2d> known = {}) const;

  PathPlannerOptions options_;
  std::unique_ptr<Searches> searches_;
};

}  // namespace blindcorner
