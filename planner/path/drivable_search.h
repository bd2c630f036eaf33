// SPDX-License-Identifier: Apache-2.0
/// Cheapest of the paths that a vehicle with a turning radius can drive.
#pragma once

#include "blindcorner/planner/path/path_planner.h"
#include "planner/path/curve.h"

namespace blindcorner {

/// A* over poses and curvatures (the hybrid A* of Dolgov, Thrun, Montemerlo and Diebel 2010, with
/// the curvature as a state). Each step is a clothoid of the same length that the vehicle can drive
/// from where it is, at the speed that it can have there (CurveLimits), and that touches nothing.
/// Its cost is the integral of the grid's cost factor times the slowness, and a little for bends.
/// The estimate of the cost that is left is that of the cheapest way over cells or, for a goal with
/// a heading, that of the shortest curve if it is larger. Of states that lie in the same cell of
/// pose and curvature, the cheapest is followed. The path found is then straightened out between
/// its nodes (Curve fitted()) as far as the vehicle can still drive it.
///
/// If the vehicle stands nearer to an obstacle than the options ask, its path may begin there, but
/// leads no deeper.
Path drivable_path(const PlanningGrid& grid, const PathRequest& request,
                   const PathPlannerOptions& options, GridSearch& cells);

/// Cells that a goal lies in: those of its line, or that of its point.
std::vector<Cell> goal_cells(const GridGeometry& geometry, const PathGoal& goal);

/// Integral of the cost factor along points, m.
double cost_along(const PlanningGrid& grid, std::span<const PathPoint> points);

}  // namespace blindcorner
