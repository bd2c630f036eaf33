// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/path_planner.h"

#include <tbb/enumerable_thread_specific.h>

#include <chrono>
#include <cmath>
#include <string>

#include "blindcorner/forward/error.h"
#include "planner/path/drivable_search.h"
#include "planner/path/turning_path.h"

namespace blindcorner {
namespace {

/// An obstacle is a risk up to this multiple of the circumscribed radius. The car of 4.5 x 1.8 m
/// then prefers 5 m of distance, the middle of a street of 10 m.
constexpr double kRiskReach = 2;

void check_place(const char* what, const Eigen::Vector2d& place,
                 const std::optional<double>& heading) {
  if (place.allFinite() && std::isfinite(heading.value_or(0))) return;
  throw Error(what, "found what is not a number, accepted: x and y in metres, heading in radians");
}

void check_number(const char* what, double value) {
  if (std::isfinite(value)) return;
  throw Error(what, "found what is not a number, accepted: a number");
}

}  // namespace

PathPlannerOptions PathPlannerOptions::car() {
  PathPlannerOptions options;
  options.footprint = VehicleFootprint::rectangle(4.5, 1.8);
  options.curves.turning_radius = 5.5;
  options.grid.risk_weight = 3;
  return options;
}

PathPlannerOptions PathPlannerOptions::robot() {
  PathPlannerOptions options;
  options.footprint = VehicleFootprint::disc(0.1);
  options.grid.risk_weight = 3;
  return options;
}

void PathPlannerOptions::validate() const {
  grid.validate();
  search.validate();
  curves.validate();
  if (point_spacing > 0 && std::isfinite(point_spacing)) return;
  throw Error("PathPlannerOptions.point_spacing = " + std::to_string(point_spacing) +
              "; accepted: a number of metres > 0");
}

/// Workspaces, one for each thread that has searched.
class PathPlanner::Searches {
 public:
  explicit Searches(const GridSearchOptions& options) : of_thread_(GridSearch(options)) {}
  GridSearch& of_this_thread() { return of_thread_.local(); }

 private:
  tbb::enumerable_thread_specific<GridSearch> of_thread_;
};

PathPlanner::PathPlanner(const PathPlannerOptions& options)
    : options_(options), searches_(std::make_unique<Searches>(options.search)) {
  options_.validate();
  const VehicleFootprint& footprint = options_.footprint;
  if (options_.grid.lethal_radius == 0) options_.grid.lethal_radius = footprint.inscribed_radius();
  if (options_.grid.risk_radius == 0) {
    options_.grid.risk_radius = kRiskReach * footprint.circumscribed_radius();
  }
}

PathPlanner::~PathPlanner() = default;
PathPlanner::PathPlanner(PathPlanner&&) noexcept = default;
PathPlanner& PathPlanner::operator=(PathPlanner&&) noexcept = default;

PlanningGrid PathPlanner::grid(const GridGeometry& geometry,
                               std::span<const double> occupancy) const {
  return {geometry, occupancy, options_.grid};
}

Path PathPlanner::plan(const PlanningGrid& grid, const PathRequest& request) const {
  check_place("start", request.start, request.start_heading);
  check_place("goal", request.goal.point, request.goal.heading);
  check_place("goal line", request.goal.line_to.value_or(request.goal.point), std::nullopt);
  check_number("start_curvature", request.start_curvature);
  check_number("speed", request.speed);
  const bool turns = options_.curves.turning_radius == 0;
  if (turns && request.goal.line_to) {
    throw Error("goal", "found a line, accepted: a point, for a turning radius of 0");
  }
  const auto begin = std::chrono::steady_clock::now();
  GridSearch& cells = searches_->of_this_thread();
  Path path = turns ? turning_path(grid, request, options_, cells)
                    : drivable_path(grid, request, options_, cells);
  if (path.found()) {
    path.length = path.points.back().arc_length;
    path.cost = cost_along(grid, path.points);
  }
  path.time = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return path;
}

}  // namespace blindcorner
