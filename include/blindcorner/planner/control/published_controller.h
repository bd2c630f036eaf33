// SPDX-License-Identifier: Apache-2.0
/// The controller of Young, Batagoda et al. 2024 (arXiv:2410.03555). It finds a way over the cells
/// of a grid (A*), puts a Bezier curve along the beginning of this way, and steers by the heading
/// error to the curve's first control point, at constant speed. It does not model dynamics and
/// serves as a comparison.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "blindcorner/planner/path/grid_search.h"
#include "blindcorner/planner/path/path.h"
#include "blindcorner/planner/path/planning_grid.h"
#include "blindcorner/planner/vehicles/vehicle_state.h"

namespace blindcorner {

/// A cubic Bezier curve: it begins at the first point towards the second, and ends at the last one.
struct BezierCurve {
  std::array<Eigen::Vector2d, 4> control{Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero(),
                                         Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()};  ///< m

  /// The point at a parameter t from 0 to 1.
  Eigen::Vector2d at(double t) const;
  /// Curvature at the curve's beginning, 1/m, positive to the left; 0 where the first two points
  /// coincide.
  double first_curvature() const;
};

/// The structure is as published; the constants are not published. The horizon is the shortest of
/// 12, 18 and 24 m with which a car drives an empty turn between streets of 16 m at 11 m/s and
/// more.
struct PublishedControllerOptions {
  double horizon = 18;   ///< m of the way that the curve spans; its control point is at a third
  double reached = 0.5;  ///< m: a control point that is nearer counts as reached
  double steering_gain = 1.5;  ///< curvature per heading error and inverse distance
  double feed_forward = 1;     ///< share of the curve's first curvature that is commanded
  double speed_gain = 2;       ///< 1/s, of the speed error

  /// Options for a vehicle whose length is not the car's 4.5 m: lengths in proportion.
  static PublishedControllerOptions of_length(double length);
  /// Throws Error naming the field.
  void validate() const;
};

/// Plans with every map and follows the curve in between. If a map has no way, the last curve
/// stays.
class PublishedController {
 public:
  explicit PublishedController(const VehicleLimits& limits,
                               const PublishedControllerOptions& options = {});

  /// Finds a way from the vehicle to the goal (of a line its middle) over the cells in which the
  /// vehicle's inscribed circle is free. If the vehicle or the goal is on another cell, the nearest
  /// such cell within `reach` m replaces it.
  PathStatus plan(const PlanningGrid& grid, const VehicleState& state, const PathGoal& goal,
                  double reach);
  /// The present request: towards the first control point, at a speed (m/s). Straight on without a
  /// plan and when the control point is reached.
  DriveRequest follow(const VehicleState& state, double speed) const;

  const BezierCurve& curve() const { return curve_; }
  /// The curve, then the rest of the way, for pictures, m.
  std::vector<Eigen::Vector2d> points() const;

 private:
  VehicleLimits limits_;
  PublishedControllerOptions options_;
  GridSearch search_;
  BezierCurve curve_;
  std::vector<Eigen::Vector2d> rest_;  ///< m, points of the way beyond the curve
  bool planned_ = false;
};

}  // namespace blindcorner
