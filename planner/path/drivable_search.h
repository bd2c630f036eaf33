// SPDX-License-Identifier: Apache-2.0
/// Cheapest of the paths that a vehicle with a turning radius can drive.
#pragma once

#include "blindcorner/planner/path/path_planner.h"
#include "planner/path/curve.h"

namespace blindcorner {

/// A* over poses and curvatures (the hybrid A* of Dolgov, Thrun, Montemerlo and Diebel 2010, with
/// the curvature as a state). A step is a clothoid of one length that the vehicle can drive from
/// where it is, with the speed that it can have there (CurveLimits), and that touches nothing. It
/// costs what the grid says of its middle, times its slowness, and a little for being bent. The
/// estimate of what is left is the cost of the cheapest way over cells. Of states that lie in the
/// same cell of pose and curvature the cheapest is followed. The path found is then straightened
/// out between its nodes (Curve fitted()) as far as it stays one that can be driven.
///
/// Where the vehicle stands nearer to an obstacle than the options ask, its path may begin so, but
/// leads no deeper.
Path drivable_path(const PlanningGrid& grid, const PathRequest& request,
                   const PathPlannerOptions& options, GridSearch& cells);

/// Cells that a goal lies in: those of its line, or the point's.
std::vector<Cell> goal_cells(const GridGeometry& geometry, const PathGoal& goal);

/// Integral of the cost factor along points, m.
double cost_along(const PlanningGrid& grid, std::span<const PathPoint> points);

}  // namespace blindcorner
