// SPDX-License-Identifier: Apache-2.0
/// The controller of Young, Batagoda et al. 2024 (arXiv:2410.03555): the way over the cells of a
/// grid (A*), a Bezier curve along its beginning, and steering by the heading error to the curve's
/// first control point, at constant speed. It knows no dynamics, and is here to compare with.
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

  /// At a parameter t from 0 to 1.
  Eigen::Vector2d at(double t) const;
  /// Where it begins, 1/m, positive to the left; 0 where the first two points are the same.
  double first_curvature() const;
};

/// Structure as published; the constants are not. The horizon is the shortest of 12, 18 and 24 m
/// with which a car drives an empty turn between streets of 16 m at 11 m/s and more.
struct PublishedControllerOptions {
  double horizon = 18;         ///< m of the way that the curve spans; a third: its control point
  double reached = 0.5;        ///< m: a nearer control point is as good as reached
  double steering_gain = 1.5;  ///< curvature over heading error and inverse distance
  double feed_forward = 1;     ///< share of the curve's first curvature that is commanded
  double speed_gain = 2;       ///< 1/s, of the speed error

  /// For a vehicle of another length than the car's 4.5 m: lengths in proportion.
  static PublishedControllerOptions of_length(double length);
  /// Throws Error naming the field.
  void validate() const;
};

/// Plans with every map, follows in between. A map without a way leaves the last curve.
class PublishedController {
 public:
  explicit PublishedController(const VehicleLimits& limits,
                               const PublishedControllerOptions& options = {});

  /// The way from the vehicle to the goal (of a line its middle) on cells that its inscribed circle
  /// can be on; a vehicle that stands on another begins at the nearest such cell within `reach` m.
  PathStatus plan(const PlanningGrid& grid, const VehicleState& state, const PathGoal& goal,
                  double reach);
  /// What to do now: towards the first control point, at a speed (m/s). Straight on without a plan.
  DriveRequest follow(const VehicleState& state, double speed) const;

  const BezierCurve& curve() const { return curve_; }
  /// The curve, then the rest of the way, for pictures, m.
  std::vector<Eigen::Vector2d> points() const;

 private:
  VehicleLimits limits_;
  PublishedControllerOptions options_;
  GridSearch search_;
  BezierCurve curve_;
  std::vector<Eigen::Vector2d> rest_;  ///< m, of the way behind the curve
  bool planned_ = false;
};

}  // namespace blindcorner
