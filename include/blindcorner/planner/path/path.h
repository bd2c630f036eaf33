// SPDX-License-Identifier: Apache-2.0
/// A path that a vehicle can follow.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "blindcorner/planner/path/bezier.h"
#include "blindcorner/planner/path/grid_search.h"

namespace blindcorner {

struct PathPoint {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  ///< m, of the vehicle's reference point
  double heading = 0;                                  ///< rad, direction of travel
  double curvature = 0;                                ///< 1/m, positive to the left
  double arc_length = 0;                               ///< m from the path's start
};

/// Between two points of a path linearly (headings the shorter way round), clamped to its ends.
/// `points` has one or more, in order of arc length. Of a curvature that is not finite the other
/// point's is taken.
PathPoint path_at(std::span<const PathPoint> points, double arc_length);

/// Arc length of the place on a path that is nearest to `position`, m, looked for within [from,
/// to]; the first of several.
double nearest_arc_length(std::span<const PathPoint> points, const Eigen::Vector2d& position,
                          double from, double to);

/// What is to be known of a path that was found.
struct PathFlags {
  bool curvature_exceeded = false;  ///< it turns tighter than the vehicle somewhere, ends included,
                                    ///< or faster into a turn than the vehicle can steer
  bool partly_unsmoothed = false;   ///< some of it follows the corners of the straight lines
  bool footprint_collides = false;  ///< the vehicle touches an obstacle, turns on the spot included
};

/// Points about evenly spaced from start to goal; one point when both are the same place.
struct Path {
  PathStatus status = PathStatus::no_path;
  std::vector<PathPoint> points;           ///< empty unless found
  std::vector<CubicBezier> pieces;         ///< the same curve; empty for a single point
  std::vector<Eigen::Vector2d> waypoints;  ///< m, corners of the straight lines before smoothing
  PathFlags flags;
  /// 1/m, of the curve; a turn on the spot counts as one within the points' spacing, half a cell at
  /// most. Infinite at a cusp.
  double greatest_curvature = 0;
  double length = 0;       ///< m
  double grid_length = 0;  ///< m, of the path over cells that it was made from
  double cost = 0;         ///< m, integral of the cost factor along it
  // Sums over the attempts that counted, which may have gone on side by side.
  std::size_t expansions = 0;  ///< cells
  double search_time = 0;      ///< s
  double smoothing_time = 0;   ///< s

  bool found() const { return status == PathStatus::found; }
  /// path_at and nearest_arc_length of its points, of which there must be one.
  PathPoint at(double arc_length) const { return path_at(points, arc_length); }
  double nearest(const Eigen::Vector2d& position, double from = 0) const {
    return nearest_arc_length(points, position, from, points.back().arc_length);
  }
};

}  // namespace blindcorner
