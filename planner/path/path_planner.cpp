// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/path_planner.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>

#include "blindcorner/forward/error.h"
#include "planner/path/other_sides.h"

namespace blindcorner {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Beyond the circumscribed radius an obstacle is a risk up to this multiple of it: the car of
/// 4.5 x 1.8 m then prefers 5 m of distance, the middle of a street of 10 m.
constexpr double kRiskReach = 2;
/// Shares of the way from the vehicle's narrow side to its circumscribed radius that a path is
/// tried with where the narrow side's does not do.
constexpr std::array kMoreRoom{0.5, 1.0};
/// Passages of a path that cannot be driven whose other side is tried.
constexpr std::size_t kMostPassages = 2;
/// Of two sides that are both too tight the other one must be less tight by this factor: who
/// changes sides for less may end before the obstacle. By judgement; curves that need 0.6 of
/// friction, tighter by as much, need nearly all of it.
constexpr double kWorthTheOtherSide = 1.5;

void check_place(const char* what, const Eigen::Vector2d& place,
                 const std::optional<double>& heading) {
  if (place.allFinite() && std::isfinite(heading.value_or(0))) return;
  throw Error(what, "found what is not a number, accepted: x and y in metres, heading in radians");
}

/// Whether a disc can move from one point to the other in a straight line.
bool can_slide(const PlanningGrid& grid, double radius, const Eigen::Vector2d& from,
               const Eigen::Vector2d& to) {
  const double step = 0.25 * grid.geometry().cell_size;
  const int steps = 1 + static_cast<int>((to - from).norm() / step);
  for (int i = 0; i <= steps; ++i) {
    if (!grid.disc_is_free(from + (to - from) * i / steps, radius)) return false;
  }
  return true;
}

/// The cell that a search begins or ends in. The vehicle may stand where it is free in a cell whose
/// centre is nearer to an obstacle: then the nearest traversable cell that it can slide to.
Cell search_cell(const PlanningGrid& grid, double radius, const Eigen::Vector2d& place) {
  const Cell own = grid.geometry().cell_at(place);
  if (!grid.geometry().contains(own) || grid.traversable(own)) return own;
  if (!grid.disc_is_free(place, radius)) return own;
  const int reach = 2 + static_cast<int>(grid.options().lethal_radius / grid.geometry().cell_size);
  Cell nearest = own;
  double least = std::numeric_limits<double>::infinity();
  for (int row = own.row - reach; row <= own.row + reach; ++row) {
    for (int column = own.column - reach; column <= own.column + reach; ++column) {
      const Cell cell{column, row};
      const double distance = (grid.geometry().center(cell) - place).norm();
      if (distance >= least || !grid.traversable(cell)) continue;
      if (!can_slide(grid, radius, place, grid.geometry().center(cell))) continue;
      least = distance;
      nearest = cell;
    }
  }
  return nearest;
}

/// From the start itself over the cells' centres to the goal itself.
std::vector<Eigen::Vector2d> points_of(const PlanningGrid& grid, const PathRequest& request,
                                       const CellPath& cells) {
  const GridGeometry& geometry = grid.geometry();
  std::vector<Eigen::Vector2d> points{request.start};
  for (const Cell& cell : cells.cells) {
    // Centres of the cells that hold the ends would be detours.
    if (cell == geometry.cell_at(request.start) || cell == geometry.cell_at(request.goal)) continue;
    points.push_back(geometry.center(cell));
  }
  points.push_back(request.goal);
  return points;
}

/// Smaller is better.
int faults(const Path& path) {
  return (path.flags.footprint_collides ? 4 : 0) + (path.flags.curvature_exceeded ? 2 : 0) +
         (path.flags.partly_unsmoothed ? 1 : 0);
}

bool is_better(const Path& a, const Path& b) {
  if (faults(a) != faults(b)) return faults(a) < faults(b);
  return a.flags.curvature_exceeded && a.greatest_curvature < b.greatest_curvature;
}

bool can_be_driven(const Path& path) {
  return path.found() && !path.flags.footprint_collides && !path.flags.curvature_exceeded;
}

bool is_worth_the_other_side(const Path& other, const Path& path) {
  if (path.flags.footprint_collides || can_be_driven(other)) return is_better(other, path);
  return !other.flags.footprint_collides &&
         other.greatest_curvature * kWorthTheOtherSide < path.greatest_curvature;
}

/// Keeps the better of two paths, with what both took.
void take_better(Path& best, Path path, bool (*better)(const Path&, const Path&) = is_better) {
  const std::size_t expansions = best.expansions + path.expansions;
  const double search_time = best.search_time + path.search_time;
  const double smoothing_time = best.smoothing_time + path.smoothing_time;
  if (path.found() && better(path, best)) best = std::move(path);
  best.expansions = expansions;
  best.search_time = search_time;
  best.smoothing_time = smoothing_time;
}

/// Paths 0 to `count` - 1, side by side, up to the first one that is enough: what follows it may be
/// left out, and is not looked at.
std::vector<Path> up_to_enough(std::size_t count, const std::function<Path(std::size_t)>& path,
                               const std::function<bool(const Path&)>& enough) {
  std::vector<Path> paths(count);
  std::atomic<std::size_t> first_enough{count};
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    if (i > first_enough) return;
    paths[i] = path(i);
    if (!enough(paths[i])) return;
    std::size_t least = first_enough;
    while (i < least && !first_enough.compare_exchange_weak(least, i)) {
    }
  });
  paths.resize(std::min(count, first_enough + 1));
  return paths;
}

}  // namespace

PathPlannerOptions PathPlannerOptions::car() {
  PathPlannerOptions options;
  options.smoothing.footprint = VehicleFootprint::rectangle(4.5, 1.8);
  options.smoothing.min_turning_radius = 5.5;
  options.grid.risk_weight = 3;
  return options;
}

PathPlannerOptions PathPlannerOptions::robot() {
  PathPlannerOptions options;
  options.smoothing.footprint = VehicleFootprint::disc(0.1);
  options.grid.risk_weight = 3;
  return options;
}

void PathPlannerOptions::validate() const {
  grid.validate();
  search.validate();
  smoothing.validate();
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
  const VehicleFootprint& footprint = options_.smoothing.footprint;
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
  check_place("goal", request.goal, request.goal_heading);
  if (!std::isfinite(request.start_curvature)) {
    throw Error("start_curvature", "found what is not a number, accepted: a number of 1/m");
  }
  // Isolated: whoever waits here must not pick up a caller's other work.
  return tbb::this_task_arena::isolate([&] { return plan_on_all_sides(grid, request); });
}

Path PathPlanner::plan_on_all_sides(const PlanningGrid& grid, const PathRequest& request) const {
  Path best = plan_with_room(grid, request);
  if (!best.found() || can_be_driven(best)) return best;
  std::vector<Passage> passages = passages_of(grid, best);
  if (passages.size() > kMostPassages) passages.resize(kMostPassages);
  const auto on_other_side = [&](std::size_t i) {
    return plan_with_room(grid.with_closed(passages[i].cells), request);
  };
  for (Path& path : up_to_enough(passages.size(), on_other_side, can_be_driven)) {
    take_better(best, std::move(path), is_worth_the_other_side);
  }
  return best;
}

Path PathPlanner::plan_with_room(const PlanningGrid& grid, const PathRequest& request) const {
  Path best = plan_once(grid, request);
  const double narrow = grid.options().lethal_radius;
  const double wide = options_.smoothing.footprint.circumscribed_radius();
  if (!best.found() || faults(best) == 0 || wide <= narrow) return best;
  const auto with_more = [&](std::size_t i) {
    return plan_once(grid.with_lethal_radius(narrow + kMoreRoom.at(i) * (wide - narrow)), request,
                     best.waypoints);
  };
  const auto faultless = [](const Path& path) { return path.found() && faults(path) == 0; };
  for (Path& path : up_to_enough(kMoreRoom.size(), with_more, faultless)) {
    take_better(best, std::move(path));
  }
  return best;
}

/// `known`: waypoints that have been smoothed already; the path of these is not made again.
Path PathPlanner::plan_once(const PlanningGrid& grid, const PathRequest& request,
                            std::span<const Eigen::Vector2d> known) const {
  auto begin = Clock::now();
  const double radius = options_.smoothing.footprint.inscribed_radius();
  const CellPath cells = searches_->of_this_thread().search(
      grid, search_cell(grid, radius, request.start), search_cell(grid, radius, request.goal));
  Path path;
  path.status = cells.status;
  const double search_time = seconds_since(begin);
  begin = Clock::now();
  if (cells.status == PathStatus::found) {
    const std::vector<Eigen::Vector2d> waypoints = shortcut(grid, points_of(grid, request, cells));
    if (std::ranges::equal(waypoints, known)) {
      path.status = PathStatus::no_path;
    } else {
      path = smooth(grid, waypoints,
                    {request.start_heading, request.goal_heading, request.start_curvature},
                    options_.smoothing);
    }
  }
  path.grid_length = cells.length;
  path.expansions = cells.expansions;
  path.search_time = search_time;
  path.smoothing_time = seconds_since(begin);
  return path;
}

}  // namespace blindcorner
