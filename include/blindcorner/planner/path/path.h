// SPDX-License-Identifier: Apache-2.0
/// A path that a vehicle can follow.
#pragma once

#include <Eigen/Core>
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

/// What is to be known of a path that was found.
struct PathFlags {
  bool curvature_exceeded = false;  ///< it turns tighter than the vehicle somewhere
  bool partly_unsmoothed = false;   ///< some of it follows the corners of the straight lines
  bool footprint_collides = false;  ///< the vehicle touches an obstacle where it turns a corner
};

/// Points about evenly spaced from start to goal; one point when both are the same place.
struct Path {
  PathStatus status = PathStatus::no_path;
  std::vector<PathPoint> points;           ///< empty unless found
  std::vector<CubicBezier> pieces;         ///< the same curve; empty for a single point
  std::vector<Eigen::Vector2d> waypoints;  ///< m, corners of the straight lines before smoothing
  PathFlags flags;
  double length = 0;           ///< m
  double grid_length = 0;      ///< m, of the path over cells that it was made from
  double cost = 0;             ///< m, integral of the cost factor along it
  std::size_t expansions = 0;  ///< cells, of all searches
  double search_time = 0;      ///< s
  double smoothing_time = 0;   ///< s

  bool found() const { return status == PathStatus::found; }
  /// Between points linearly (headings the shorter way round), clamped to its ends. The path must
  /// have a point.
  PathPoint at(double arc_length) const;
  /// Arc length of the path's point nearest to `position`, m, at least `from`; the first of
  /// several. The path must have a point.
  double nearest(const Eigen::Vector2d& position, double from = 0) const;
};

}  // namespace blindcorner
