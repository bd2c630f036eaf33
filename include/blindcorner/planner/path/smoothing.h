// SPDX-License-Identifier: Apache-2.0
/// From steps between cells to a curve that a vehicle can follow.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "blindcorner/planner/path/path.h"
#include "blindcorner/planner/path/planning_grid.h"
#include "blindcorner/planner/path/vehicle_footprint.h"

namespace blindcorner {

struct SmoothingOptions {
  VehicleFootprint footprint;
  /// The vehicle turns no tighter, m; 0: it can turn on the spot.
  double min_turning_radius = 0;
  /// The vehicle's curvature changes no faster, 1/m^2: its steering rate over wheelbase and speed.
  /// 0: at once.
  double max_curvature_rate = 0;
  /// Distance between points of the path, m; 0: half a cell.
  double point_spacing = 0;
  /// Most rounds in which the curve is pushed off obstacles and flattened.
  int max_rounds = 60;

  /// Throws Error naming the field.
  void validate() const;
};

/// Corners of straight lines that replace steps between cells wherever the line is free and costs
/// no more (line_cost). First and last are those of `points`. Greedy from both ends, as in
/// Botea, Mueller & Schaeffer 2004, with costs.
std::vector<Eigen::Vector2d> shortcut(const PlanningGrid& grid,
                                      std::span<const Eigen::Vector2d> points);

/// Ends of a path; a heading that is not given is free.
struct PathEnds {
  std::optional<double> start_heading, goal_heading;  ///< rad
  double start_curvature = 0;  ///< 1/m, left is positive; counts where `start_heading` is given
};

/// Poses along a path's curve that a collision is looked for at: an eighth of a cell apart whatever
/// the spacing of the path's points, in turns on the spot no part of the vehicle moves farther.
/// Arc lengths repeat in turns. With `ends` also the turns from and to the headings given there.
std::vector<PathPoint> checked_poses(const PlanningGrid& grid, const Path& path,
                                     const PathEnds& ends, const VehicleFootprint& footprint);

/// Points, pieces, flags and length of a path along `waypoints` (first and last are its ends).
///
/// The curve is a uniform cubic B-spline, kept as Bezier pieces: curvature is continuous. Its
/// control points p minimise sum |p[i-1] - 2 p[i] + p[i+1]|^2 + sum w[i] |p[i] - q[i]|^2, q evenly
/// spaced along the waypoints. Where the vehicle touches an obstacle, q is pushed away from it;
/// where the curve is too tight, or changes its curvature too fast, w is lowered. Where that ends
/// without success, and there is a turning radius, everything is asked of all points at once,
/// by nonlinear least squares (planner/path/least_curved.h). Of the curves that touch nothing the
/// one that exceeds the limits least is taken. Where there is none, w is raised until the curve
/// follows the waypoints again, and the flags say so. Where that collides as well, the path is the
/// straight lines themselves, with turns on the spot at their corners and from and to the headings
/// of the ends. Collision and curvature are checked at points an eighth of a cell apart.
Path smooth(const PlanningGrid& grid, std::span<const Eigen::Vector2d> waypoints,
            const PathEnds& ends, const SmoothingOptions& options);

}  // namespace blindcorner
