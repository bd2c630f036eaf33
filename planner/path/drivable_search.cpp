// SPDX-License-Identifier: Apache-2.0
#include "planner/path/drivable_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <queue>
#include <unordered_map>

#include "blindcorner/forward/constants.h"
#include "blindcorner/planner/vehicles/vehicle_state.h"
#include "planner/path/dubins.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;

constexpr double kNever = std::numeric_limits<double>::infinity();
/// Length of a step as a share of the turning radius: 14 degrees of a turn. A step is at most half
/// a vehicle's length and at least kFewestCells cells long.
constexpr double kStepOfRadius = 0.25;
constexpr double kFewestCells = 2;
/// Number of curvatures, to each side of straight on and up to the limit, with which steps end.
constexpr int kLevels = 4;
/// Parts of a step and parts of a turn by which states are told apart.
constexpr double kPositionBins = 2;
constexpr int kHeadingBins = 72;
/// Number of headings that a path may begin with if any heading will do.
constexpr int kStartHeadings = 24;
/// Additional price of a metre, in metres: with the greatest curvature, and in a step over which
/// the curvature changes by as much.
constexpr double kBent = 0.2, kSteered = 0.2;
/// Number of states after which the search gives up and says that there is no path: a second.
constexpr std::size_t kMostStates = 150'000;
/// A fitted curve may exceed the limits of curvature and of its rate by this share.
constexpr double kRounding = 0.02;
/// A goal that is a point is met when the end is this near to it, in cells.
constexpr double kMet = 0.02;
constexpr double kMetHeading = 0.01;  ///< rad
/// The end of a path is bent to a goal if the path passes it by up to half a step, with a heading
/// that is off by less than this, rad.
constexpr double kHeadingNear = 0.3;
/// A vehicle has to leave what it touches at the start within this many of its lengths.
constexpr double kLeavesWithin = 1.5;
/// Depth by which discs may be deeper in an obstacle than at the start, m.
constexpr double kDeeper = 0.01;

/// A state of the search: where a step ended.
struct Node {
  PathPoint place;  ///< its arc length is that of the path
  double cost = 0;  ///< m
  std::int32_t from = -1;
  bool at_goal = false;
};

struct Open {
  double estimate = 0;  ///< m, of the whole path
  std::int32_t node = 0;
  bool operator<(const Open& other) const { return estimate > other.estimate; }
};

class DrivableSearch {
 public:
  DrivableSearch(const PlanningGrid& grid, const PathRequest& request,
                 const PathPlannerOptions& options, GridSearch& cells);
  std::optional<Curve> run();
  std::size_t expansions() const { return expansions_; }

 private:
  void begin();
  void begin_with(double heading, double curvature, double cost);
  void expand(std::int32_t index);
  void step(std::int32_t index, double curvature);
  void add(const Node& node);
  double left_from(const PathPoint& place) const;
  double left_over_cells(const Vector2d& position) const;
  bool is_near_goal(const PathPoint& place) const;
  bool may_be_at(const PathPoint& place) const;
  std::uint64_t key(const PathPoint& place) const;
  std::optional<Curve> curve_to(std::int32_t index) const;
  std::optional<Curve> straightened(const Curve& found) const;
  bool drivable(const Curve& curve) const;
  double curvature_limit(double arc_length) const {
    return options_.curves.curvature(options_.curves.speed(request_.speed, arc_length));
  }
  double rate_limit(double arc_length) const {
    return options_.curves.curvature_rate(options_.curves.speed(request_.speed, arc_length));
  }

  const PlanningGrid& grid_;
  const PathRequest& request_;
  const PathPlannerOptions& options_;
  double step_, sample_;          ///< m
  std::vector<double> left_;      ///< [cells] m to the goal
  std::vector<double> overlaps_;  ///< [discs] m at the start; empty: it touches nothing
  double tightest_;               ///< 1/m
  std::vector<Node> nodes_;
  std::priority_queue<Open> open_;
  std::unordered_map<std::uint64_t, double> best_;  ///< least cost of a state
  std::size_t expansions_ = 0;
};

DrivableSearch::DrivableSearch(const PlanningGrid& grid, const PathRequest& request,
                               const PathPlannerOptions& options, GridSearch& cells)
    : grid_(grid), request_(request), options_(options) {
  const double cell = grid.geometry().cell_size;
  const double radius = options.curves.turning_radius;
  const double reach = options.footprint.circumscribed_radius();
  step_ =
      std::max(kFewestCells * cell, std::min(kStepOfRadius * radius, reach > 0 ? reach : kNever));
  sample_ = step_ / std::ceil(step_ / cell);
  tightest_ = 1 / radius;
  left_ = cells.costs_to(grid, goal_cells(grid.geometry(), request.goal));
}

void DrivableSearch::begin() {
  if (request_.start_heading) {
    const PlanarPose pose{request_.start, *request_.start_heading};
    if (!grid_.is_free(options_.footprint, pose)) {
      overlaps_ = grid_.overlaps(options_.footprint, pose);
    }
    // A path has the heading of the reference point's course. The vehicle points to the outside of
    // it.
    const double drift = yaw_on_path(0, request_.start_curvature, options_.footprint.rear_axle());
    begin_with(*request_.start_heading - drift, request_.start_curvature, 0);
    if (!options_.turns_on_the_spot) return;
  }
  const double reach = options_.footprint.circumscribed_radius();
  if (request_.start_heading && !grid_.disc_is_free(request_.start, reach)) return;
  for (int i = 0; i < kStartHeadings; ++i) {
    const double heading = 2 * kPi * i / kStartHeadings;
    const double turn =
        request_.start_heading ? std::remainder(heading - *request_.start_heading, 2 * kPi) : 0.0;
    const PlanarPose pose{request_.start, heading};
    if (!grid_.is_free(options_.footprint, pose)) continue;
    // A turn on the spot costs the way of the vehicle's corners, and more because the vehicle has
    // to stop.
    const double stop = request_.start_heading ? reach : 0.0;
    begin_with(heading, 0, stop + std::abs(turn) * reach);
  }
}

void DrivableSearch::begin_with(double heading, double curvature, double cost) {
  Node node;
  node.place = {request_.start, heading, curvature, 0};
  node.cost = cost;
  add(node);
}

/// Estimate of the cost that is left, m: by the cells and, if the goal has a heading, by the
/// turning radius.
double DrivableSearch::left_from(const PathPoint& place) const {
  const double over_cells = left_over_cells(place.position);
  const PathGoal& goal = request_.goal;
  if (!goal.heading || over_cells == kNever) return over_cells;
  const double curve = dubins_length({place.position, place.heading}, {goal.point, *goal.heading},
                                     options_.curves.turning_radius);
  return std::max(over_cells, grid_.least_cost_factor() * curve);
}

/// Cost that is left over cells, m. A vehicle may be free in a cell whose centre is too near to an
/// obstacle: the cheapest neighbour then counts.
double DrivableSearch::left_over_cells(const Vector2d& position) const {
  const GridGeometry& geometry = grid_.geometry();
  const Cell own = geometry.cell_at(position);
  if (geometry.contains(own) && left_[geometry.index(own)] < kNever) {
    return left_[geometry.index(own)];
  }
  double least = kNever;
  for (std::size_t k = 0; k < kSteps; ++k) {
    const Cell cell{own.column + kStepColumns[k], own.row + kStepRows[k]};
    if (geometry.contains(cell)) least = std::min(least, left_[geometry.index(cell)]);
  }
  return least + geometry.cell_size;
}

std::uint64_t DrivableSearch::key(const PathPoint& place) const {
  const Vector2d at = kPositionBins / step_ * (place.position - grid_.geometry().origin);
  const double turns = place.heading / (2 * kPi);
  const auto heading = static_cast<std::uint64_t>((turns - std::floor(turns)) * kHeadingBins);
  const double limit = curvature_limit(place.arc_length);
  const auto level = static_cast<std::uint64_t>(
      std::clamp(std::round(kLevels * place.curvature / limit), -2.0 * kLevels, 2.0 * kLevels) +
      2 * kLevels);
  const auto column = static_cast<std::uint64_t>(std::max(0.0, at.x()));
  const auto row = static_cast<std::uint64_t>(std::max(0.0, at.y()));
  return ((column << 22U | row) << 8U | heading) << 6U | level;
}

void DrivableSearch::add(const Node& node) {
  double left = node.at_goal ? 0 : left_from(node.place);
  if (left == kNever) {
    // This is allowed only on the way out of what the vehicle touches at the start.
    if (node.place.arc_length > 0 && overlaps_.empty()) return;
    left = node.from < 0 ? 0 : (node.place.position - nodes_.front().place.position).norm();
    if (node.place.arc_length > kLeavesWithin * 2 * options_.footprint.circumscribed_radius()) {
      return;
    }
  }
  // Ends that are bent to the goal are told apart from places beside it.
  const std::uint64_t state = key(node.place) | (node.at_goal ? std::uint64_t{1} << 63U : 0);
  const auto [known, is_new] = best_.try_emplace(state, node.cost);
  if (!is_new && known->second <= node.cost) return;
  known->second = node.cost;
  nodes_.push_back(node);
  open_.push({node.cost + left, static_cast<std::int32_t>(nodes_.size() - 1)});
}

bool DrivableSearch::may_be_at(const PathPoint& place) const {
  const PlanarPose pose = body_on_path(options_.footprint, place);
  const MoverAvoidance avoidance{request_.movers, request_.speed};
  if (avoidance.meets(options_.footprint, pose, place.arc_length,
                      {request_.start, request_.start_heading.value_or(place.heading)})) {
    return false;
  }
  if (grid_.is_free(options_.footprint, pose)) return true;
  const bool leaving =
      !overlaps_.empty() &&
      place.arc_length <= kLeavesWithin * 2 * options_.footprint.circumscribed_radius() &&
      grid_.geometry().contains(grid_.geometry().cell_at(place.position));
  if (!leaving) return false;
  const std::vector<double> now = grid_.overlaps(options_.footprint, pose);
  for (std::size_t disc = 0; disc < now.size(); ++disc) {
    if (now[disc] > overlaps_[disc] + kDeeper) return false;
  }
  return true;
}

bool DrivableSearch::is_near_goal(const PathPoint& place) const {
  const PathGoal& goal = request_.goal;
  if (goal.line_to) return false;
  const Vector2d off = goal.point - place.position;
  const Vector2d ahead(std::cos(place.heading), std::sin(place.heading));
  const double beside = std::abs(ahead.x() * off.y() - ahead.y() * off.x());
  if (std::abs(ahead.dot(off)) > sample_ || beside > step_ / 2) return false;
  return !goal.heading ||
         std::abs(std::remainder(*goal.heading - place.heading, 2 * kPi)) < kHeadingNear;
}

void DrivableSearch::expand(std::int32_t index) {
  ++expansions_;
  const PathPoint place = nodes_[static_cast<std::size_t>(index)].place;
  const double limit = curvature_limit(place.arc_length + step_);
  const double change = std::min(rate_limit(place.arc_length) * step_, 2 * tightest_);
  double last = kNever;
  for (int level = -kLevels; level <= kLevels; ++level) {
    const double wanted = limit * level / kLevels;
    const double reached = std::clamp(wanted, place.curvature - change, place.curvature + change);
    if (std::abs(reached) > limit && std::abs(reached) > std::abs(place.curvature)) continue;
    if (std::abs(reached - last) < 1e-9) continue;
    last = reached;
    step(index, reached);
  }
}

void DrivableSearch::step(std::int32_t index, double curvature) {
  const Node from = nodes_[static_cast<std::size_t>(index)];
  const double rate = (curvature - from.place.curvature) / step_;
  const auto samples = static_cast<int>(std::round(step_ / sample_));
  Node node{from.place, from.cost, index, false};
  for (int i = 1; i <= samples; ++i) {
    const PathPoint before = node.place;
    const double bent = from.place.curvature + rate * sample_ * i;
    node.place = advanced(before, bent, sample_);
    if (!may_be_at(node.place)) return;
    const Cell cell = grid_.geometry().cell_at(before.position);
    const double factor = grid_.cost_factor(grid_.geometry().index(cell));
    const double turning = bent / tightest_, steering = rate * step_ / tightest_;
    node.cost += sample_ * (factor * options_.curves.slowness(bent, rate) +
                            kBent * turning * turning + kSteered * steering * steering);
    const auto crossing = request_.goal.crossing(before.position, node.place.position);
    if (crossing) node.place.arc_length = before.arc_length + sample_ * *crossing;
    node.at_goal = crossing.has_value() || is_near_goal(node.place);
    if (node.at_goal) {
      const double beside = crossing ? 0.0 : (node.place.position - request_.goal.point).norm();
      node.cost += 2 * beside;  // the end will be bent towards the goal
      break;
    }
  }
  add(node);
}

std::optional<Curve> DrivableSearch::run() {
  begin();
  while (!open_.empty() && nodes_.size() < kMostStates) {
    const std::int32_t index = open_.top().node;
    open_.pop();
    const Node& node = nodes_[static_cast<std::size_t>(index)];
    if (node.at_goal) {
      if (std::optional<Curve> curve = curve_to(index)) return curve;
    } else if (best_.at(key(node.place)) >= node.cost) {
      expand(index);
    }
  }
  return std::nullopt;
}

std::optional<Curve> DrivableSearch::curve_to(std::int32_t index) const {
  Curve curve;
  curve.spacing = step_;
  curve.length = nodes_[static_cast<std::size_t>(index)].place.arc_length;
  std::vector<std::int32_t> way;
  for (std::int32_t i = index; i >= 0; i = nodes_[static_cast<std::size_t>(i)].from) {
    way.push_back(i);
  }
  std::ranges::reverse(way);
  curve.start = nodes_[static_cast<std::size_t>(way.front())].place;
  for (const std::int32_t i : way) {
    curve.curvature.push_back(nodes_[static_cast<std::size_t>(i)].place.curvature);
  }
  // The last node has the curvature of the place where the step was cut off. It is extrapolated to
  // the end of a whole step.
  const double before = curve.spacing * static_cast<double>(way.size() - 2);
  const double share = (curve.length - before) / curve.spacing;
  double& last = curve.curvature.back();
  const double previous = curve.curvature[way.size() - 2];
  if (share > 0.05 && share < 1) last = previous + (last - previous) / share;
  return straightened(curve);
}

std::optional<Curve> DrivableSearch::straightened(const Curve& found) const {
  const PathGoal& goal = request_.goal;
  const PathPoint last = found.points(sample_).back();
  CurveEnd end{last.position, last.heading};
  Curve start = found;
  if (!goal.line_to) {
    end = {goal.point, goal.heading};
    const Vector2d ahead(std::cos(last.heading), std::sin(last.heading));
    start.length = std::max(0.5 * sample_, start.length + ahead.dot(goal.point - last.position));
  }
  for (const double weight : {1.0, 0.2, 0.0}) {
    if (goal.line_to && weight == 0) break;
    const Curve curve = fitted(start, end, weight);
    if (drivable(curve)) return curve;
  }
  return goal.line_to && drivable(found) ? std::optional(found) : std::nullopt;
}

/// Whether a curve keeps all limits, touches nothing, and ends at the goal.
bool DrivableSearch::drivable(const Curve& curve) const {
  const std::vector<PathPoint> points = curve.points(sample_);
  for (const PathPoint& point : points) {
    if (!point.position.allFinite() || !may_be_at(point)) return false;
  }
  const double more = 1 + kRounding;
  for (std::size_t i = 1; i < curve.curvature.size(); ++i) {
    const double s = curve.spacing * static_cast<double>(i);
    const double before = curve.curvature[i - 1], here = curve.curvature[i];
    const double change = rate_limit(s - curve.spacing) * curve.spacing;
    const bool straighter = std::abs(here) <= std::abs(before);
    if (std::abs(here) > more * curvature_limit(s) && !straighter) return false;
    if (std::abs(here - before) > more * change + 1e-9) return false;
  }
  if (request_.goal.line_to) return true;
  const PathPoint& last = points.back();
  const double miss = (last.position - request_.goal.point).norm();
  const double turn =
      request_.goal.heading ? std::remainder(*request_.goal.heading - last.heading, 2 * kPi) : 0.0;
  return miss <= kMet * grid_.geometry().cell_size && std::abs(turn) <= kMetHeading;
}

PathStatus status_of_ends(const PlanningGrid& grid, const PathRequest& request) {
  const GridGeometry& geometry = grid.geometry();
  const Cell start = geometry.cell_at(request.start);
  if (!geometry.contains(start)) return PathStatus::start_outside;
  if (grid.obstacle(geometry.index(start))) return PathStatus::start_blocked;
  const std::vector<Cell> goals = goal_cells(geometry, request.goal);
  if (goals.empty()) return PathStatus::goal_outside;
  const bool open =
      std::ranges::any_of(goals, [&](const Cell& cell) { return grid.traversable(cell); });
  return open ? PathStatus::found : PathStatus::goal_blocked;
}

}  // namespace

std::vector<Cell> goal_cells(const GridGeometry& geometry, const PathGoal& goal) {
  std::vector<Cell> cells;
  const Vector2d line = goal.line_to.value_or(goal.point) - goal.point;
  const int pieces = static_cast<int>(std::ceil(2 * line.norm() / geometry.cell_size));
  for (int i = 0; i <= pieces; ++i) {
    const double share = pieces > 0 ? static_cast<double>(i) / pieces : 0.0;
    const Cell cell = geometry.cell_at(goal.point + share * line);
    if (!geometry.contains(cell) || (!cells.empty() && cells.back() == cell)) continue;
    cells.push_back(cell);
  }
  return cells;
}

double cost_along(const PlanningGrid& grid, std::span<const PathPoint> points) {
  double cost = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const Cell cell = grid.geometry().cell_at(0.5 * (points[i - 1].position + points[i].position));
    const double factor =
        grid.geometry().contains(cell) ? grid.cost_factor(grid.geometry().index(cell)) : 1;
    cost += factor * (points[i].arc_length - points[i - 1].arc_length);
  }
  return cost;
}

Path drivable_path(const PlanningGrid& grid, const PathRequest& request,
                   const PathPlannerOptions& options, GridSearch& cells) {
  Path path;
  path.status = status_of_ends(grid, request);
  if (path.status != PathStatus::found) return path;
  if (!request.goal.line_to && request.start == request.goal.point) {
    path.points = {{request.start, request.start_heading.value_or(0), 0, 0}};
    return path;
  }
  DrivableSearch search(grid, request, options, cells);
  const std::optional<Curve> curve = search.run();
  path.expansions = search.expansions();
  path.status = curve ? PathStatus::found : PathStatus::no_path;
  if (curve) path.points = curve->points(options.point_spacing);
  return path;
}

}  // namespace blindcorner
