// SPDX-License-Identifier: Apache-2.0
/// The flattest curve through a narrow place, by nonlinear least squares.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "blindcorner/planner/path/planning_grid.h"
#include "blindcorner/planner/path/vehicle_footprint.h"

namespace blindcorner {

/// Distance of each cell's centre from the nearest obstacle, negative within obstacles, m, up to
/// `farthest` either way.
std::vector<double> signed_clearance(const PlanningGrid& grid, double farthest);

/// What a curve is held to.
struct CurveLimits {
  VehicleFootprint footprint;
  double turning_radius = 1;            ///< m, > 0
  double curvature_rate = 0;            ///< 1/m^2; 0: any
  double margin = 0;                    ///< m, kept from obstacles beside the footprint's own
  Eigen::Vector2d start_bend = {0, 0};  ///< m, as spline_pieces has it
  /// Control points at each end that stay where they are.
  std::size_t fixed_first = 1, fixed_last = 1;
};

/// Control points of a uniform cubic B-spline (spline_pieces), four or more, moved so as to
/// minimise, over the arc length s in turning radii R, the integral of
///   curved^2 (R k - 1)^2 + steered^2 (k' / rate - 1)^2 (where they are positive)
///   + touches^2 (distance short of the margin / cell)^2
///   + bent^2 (R p'')^2 + drawn^2 |p - start|^2 / R^2,
/// k the curvature, by Levenberg-Marquardt from `start`: the terms of Dolgov, Thrun, Montemerlo &
/// Diebel, "Path Planning for Autonomous Vehicles in Unknown Semi-structured Environments" (IJRR
/// 2010), in their order of weight. Distances are interpolated between cells, so what comes out has
/// to be checked. `clearance`: signed_clearance.
std::vector<Eigen::Vector2d> least_curved(const PlanningGrid& grid,
                                          const std::vector<double>& clearance,
                                          const std::vector<Eigen::Vector2d>& start,
                                          const CurveLimits& limits);

}  // namespace blindcorner
