// SPDX-License-Identifier: Apache-2.0
#include "planner/path/turning_path.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "blindcorner/forward/constants.h"
#include "planner/path/curve.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;

/// Rounding begins at most half of the shorter line before a corner. If that is not free, half as
/// much is tried, down to this many cells.
constexpr double kLeastRounded = 0.25;
/// Corners sharper than this are turned on the spot, rad.
constexpr double kSharp = 0.9 * kPi;
/// Largest distance between places that are checked, in cells.
constexpr double kLookedAt = 0.25;

double direction(const Vector2d& vector) { return std::atan2(vector.y(), vector.x()); }

/// Whether a disc can move from one point to the other in a straight line.
bool can_slide(const PlanningGrid& grid, double radius, const Vector2d& from, const Vector2d& to) {
  const double step = kLookedAt * grid.geometry().cell_size;
  const int steps = 1 + static_cast<int>((to - from).norm() / step);
  for (int i = 0; i <= steps; ++i) {
    if (!grid.disc_is_free(from + (to - from) * i / steps, radius)) return false;
  }
  return true;
}

/// The cell that a search begins or ends in. The vehicle may be free in a cell whose centre is too
/// near to an obstacle: the nearest traversable cell that it can slide to is then taken.
Cell search_cell(const PlanningGrid& grid, double radius, const Vector2d& place) {
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
std::vector<Vector2d> points_of(const PlanningGrid& grid, const PathRequest& request,
                                const CellPath& cells) {
  const GridGeometry& geometry = grid.geometry();
  std::vector<Vector2d> points{request.start};
  for (const Cell& cell : cells.cells) {
    // Centres of the cells that hold the ends would be detours.
    const bool end =
        cell == geometry.cell_at(request.start) || cell == geometry.cell_at(request.goal.point);
    if (!end) points.push_back(geometry.center(cell));
  }
  points.push_back(request.goal.point);
  return points;
}

/// A way that is put together from straight lines, bends and turns on the spot. Each part is
/// checked when it is added.
class Track {
 public:
  Track(const PlanningGrid& grid, const PathPlannerOptions& options, const Vector2d& start)
      : grid_(grid), options_(options) {
    looked_at_ = kLookedAt * grid.geometry().cell_size;
    end_.position = start;
  }

  void face(double heading) { end_.heading = heading; }
  void turn(double heading);
  void drive(const Vector2d& to);
  bool bend(const Vector2d& corner, double turn, double tangent);
  const std::vector<PathPoint>& points() const { return points_; }
  bool free() const { return free_; }

 private:
  bool is_free(const PathPoint& at) const {
    return grid_.is_free(options_.footprint, {at.position, at.heading});
  }
  void add(const PathPoint& point);

  const PlanningGrid& grid_;
  const PathPlannerOptions& options_;
  double looked_at_;  ///< m
  PathPoint end_;
  std::vector<PathPoint> points_;
  bool free_ = true;
};

void Track::add(const PathPoint& point) {
  free_ = free_ && is_free(point);
  if (!points_.empty() && point.arc_length <= points_.back().arc_length) {
    points_.back().heading = point.heading;
  } else {
    points_.push_back(point);
  }
}

/// Turns on the spot. The turn's point gets a curvature whose integral over the two neighbouring
/// intervals is the turn's angle.
void Track::turn(double heading) {
  const double angle = std::remainder(heading - end_.heading, 2 * kPi);
  const double reach = options_.footprint.circumscribed_radius();
  const int steps = 1 + static_cast<int>(std::abs(angle) * reach / looked_at_);
  const double before = end_.heading;
  for (int i = 0; i <= steps; ++i) {
    end_.heading = before + angle * i / steps;
    free_ = free_ && is_free(end_);
  }
  if (!points_.empty()) {
    points_.back().heading = end_.heading;
    points_.back().curvature = angle / options_.point_spacing;
  }
}

void Track::drive(const Vector2d& to) {
  const double length = (to - end_.position).norm();
  if (points_.empty()) add(end_);
  if (length == 0) return;
  const auto pieces = static_cast<int>(std::ceil(length / options_.point_spacing));
  const auto looks = static_cast<int>(std::ceil(length / pieces / looked_at_));
  const PathPoint from = end_;
  for (int i = 1; i <= pieces * looks; ++i) {
    const double share = static_cast<double>(i) / (pieces * looks);
    end_.position = from.position + share * (to - from.position);
    end_.arc_length = from.arc_length + share * length;
    end_.curvature = 0;
    free_ = free_ && is_free(end_);
    if (i % looks == 0) add(end_);
  }
}

/// Drives straight on to `tangent` m before a corner and then a bend by an angle, on which the
/// curvature rises evenly and falls evenly. If the bend is not free, returns false and drives
/// nothing.
bool Track::bend(const Vector2d& corner, double angle, double tangent) {
  const Curve unit{{}, 0.5, 1, {0, 2 * angle, 0}};
  const double chord = unit.points(0.05).back().position.norm();
  const double length = 2 * tangent * std::cos(angle / 2) / chord;
  Curve curve{end_, length / 2, length, {0, 2 * angle / length, 0}};
  curve.start.position =
      corner - tangent * Vector2d(std::cos(end_.heading), std::sin(end_.heading));
  const std::vector<PathPoint> looks = curve.points(looked_at_);
  if (!std::ranges::all_of(looks, [&](const PathPoint& at) { return is_free(at); })) return false;
  drive(curve.start.position);
  const double begun = end_.arc_length;
  for (PathPoint point : curve.points(std::min(options_.point_spacing, length / 4))) {
    point.arc_length += begun;
    add(point);
    end_ = point;
  }
  return true;
}

Track drawn(const PlanningGrid& grid, const std::vector<Vector2d>& corners,
            const PathRequest& request, const PathPlannerOptions& options) {
  Track track(grid, options, corners.front());
  track.face(request.start_heading.value_or(direction(corners[1] - corners[0])));
  track.turn(direction(corners[1] - corners[0]));
  for (std::size_t i = 1; i + 1 < corners.size(); ++i) {
    const Vector2d in = corners[i] - corners[i - 1], out = corners[i + 1] - corners[i];
    const double angle = std::remainder(direction(out) - direction(in), 2 * kPi);
    double tangent = std::min(in.norm(), out.norm()) / 2;
    bool bent = false;
    const double least = kLeastRounded * grid.geometry().cell_size;
    for (; tangent >= least && std::abs(angle) < kSharp && !bent; tangent /= 2) {
      bent = track.bend(corners[i], angle, tangent);
    }
    if (bent) continue;
    track.drive(corners[i]);
    track.turn(direction(out));
  }
  track.drive(corners.back());
  if (request.goal.heading) track.turn(*request.goal.heading);
  return track;
}

}  // namespace

Path turning_path(const PlanningGrid& grid, const PathRequest& request,
                  const PathPlannerOptions& options, GridSearch& cells) {
  const double narrow = options.footprint.inscribed_radius();
  Path path;
  for (const double radius : std::array{narrow, options.footprint.circumscribed_radius()}) {
    const PlanningGrid wide = grid.with_lethal_radius(radius);
    const CellPath way = cells.search(wide, search_cell(wide, narrow, request.start),
                                      search_cell(wide, narrow, request.goal.point));
    path.expansions += way.expansions;
    if (way.status != PathStatus::found) {
      if (radius == narrow) path.status = way.status;
      break;
    }
    path.status = PathStatus::no_path;
    const std::vector<Vector2d> points = points_of(wide, request, way);
    // Where a line that is free by its cells touches something, the way over the cells' centres is
    // tried.
    for (const std::vector<Vector2d>& corners : {shortcut(wide, points), points}) {
      if (corners.front() == corners.back() && corners.size() == 2) {
        path.points = {{request.start, request.start_heading.value_or(0), 0, 0}};
        path.status = PathStatus::found;
        return path;
      }
      const Track track = drawn(grid, corners, request, options);
      if (!track.free()) continue;
      path.points = track.points();
      path.status = PathStatus::found;
      return path;
    }
  }
  return path;
}

}  // namespace blindcorner
