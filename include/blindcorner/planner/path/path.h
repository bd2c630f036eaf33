// SPDX-License-Identifier: Apache-2.0
/// A path that a vehicle can follow.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "blindcorner/planner/path/grid_search.h"

namespace blindcorner {

struct PathPoint {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  ///< m, of the vehicle's reference point
  double heading = 0;                                  ///< rad, direction of travel
  double curvature = 0;                                ///< 1/m, positive to the left
  double arc_length = 0;                               ///< m from the path's start
};

/// Pose of a body whose reference point drives through a point of a path.
PlanarPose body_on_path(const VehicleFootprint& body, const PathPoint& place);

/// Interpolates linearly between two points of a path (headings the shorter way round), clamped to
/// the path's ends. `points` holds one or more points, in order of arc length.
PathPoint path_at(std::span<const PathPoint> points, double arc_length);

/// Arc length of the place on a path that is nearest to `position`, m, within [from, to]; the first
/// place if there are several.
double nearest_arc_length(std::span<const PathPoint> points, const Eigen::Vector2d& position,
                          double from, double to);

/// Where a path ends: at a point, or anywhere on a line.
struct PathGoal {
  Eigen::Vector2d point = Eigen::Vector2d::Zero();  ///< m; one end of a line
  std::optional<double> heading;                    ///< rad, at a point; empty: any heading
  std::optional<Eigen::Vector2d> line_to;           ///< m, the other end of a line

  /// Share of the way between two points at which the way crosses the line; empty: it does not
  /// cross, or the goal is a point.
  std::optional<double> crossing(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const;
};

/// Roughly evenly spaced points from start to goal; one point when both are the same place. If a
/// path is found, the vehicle can drive it without touching anything.
struct Path {
  PathStatus status = PathStatus::no_path;
  std::vector<PathPoint> points;  ///< empty unless found
  double length = 0;              ///< m
  double cost = 0;                ///< m, integral of the cost factor along the path
  std::size_t expansions = 0;     ///< of the search: cells or poses
  double time = 0;                ///< s, run time of the plan

  bool found() const { return status == PathStatus::found; }
  double greatest_curvature() const;  ///< 1/m, of the points
  /// path_at and nearest_arc_length of the path's points; the path must have a point.
  PathPoint at(double arc_length) const { return path_at(points, arc_length); }
  double nearest(const Eigen::Vector2d& position, double from = 0) const {
    return nearest_arc_length(points, position, from, points.back().arc_length);
  }
};

}  // namespace blindcorner
