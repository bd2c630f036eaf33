// SPDX-License-Identifier: Apache-2.0
/// Paths of vehicles that turn on the spot, on any map.
#pragma once

#include "blindcorner/planner/path/path_planner.h"

namespace blindcorner {

/// The cheapest way over cells, with straight lines in place of steps, and corners rounded by
/// clothoids as far as there is room. Where there is no room, the vehicle turns on the spot. If
/// there is no room for that either, another way is searched for on which the vehicle can turn
/// anywhere.
Path turning_path(const PlanningGrid& grid, const PathRequest& request,
                  const PathPlannerOptions& options, GridSearch& cells);

/// Corners of straight lines that replace steps between cells wherever the line is free and costs
/// no more (line_cost). First and last are those of `points`. Greedy from both ends, as in
/// Botea, Mueller & Schaeffer 2004, with costs.
std::vector<Eigen::Vector2d> shortcut(const PlanningGrid& grid,
                                      std::span<const Eigen::Vector2d> points);

}  // namespace blindcorner
