// SPDX-License-Identifier: Apache-2.0
/// Where a vehicle may drive and at what cost, from the probabilities of an occupancy grid.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "blindcorner/planner/grid/grid_geometry.h"
#include "blindcorner/planner/path/vehicle_footprint.h"

namespace blindcorner {

struct PlanningGridOptions {
  /// A cell is an obstacle from this probability on (ROS maps: 0.65).
  double occupied_threshold = 0.65;
  /// Probability used for a cell whose occupancy is unknown (NaN). Below `occupied_threshold` the
  /// vehicle may plan through such a cell at a cost; 1 closes unknown cells.
  double unknown_occupancy = 0.5;
  /// The centres of a path's cells stay at least this far from obstacles, m:
  /// `VehicleFootprint::inscribed_radius()`.
  double lethal_radius = 0;
  /// Distance at which an obstacle (probability 1) stops being a risk, m; a cell of probability p
  /// stops at sqrt(p) of it. Somewhat more than `VehicleFootprint::circumscribed_radius()`. 0: only
  /// the cell itself is a risk.
  double risk_radius = 0;
  /// A metre at risk r (0 to 1) costs 1 + risk_weight * r metres.
  double risk_weight = 0;
  /// Whether the vehicle must not reach across the map's border.
  bool closed_border = false;

  /// Throws Error naming the field.
  void validate() const;
};

/// The eight steps from a cell, counter-clockwise from +x; odd steps are diagonal.
inline constexpr int kSteps = 8;
inline constexpr std::array<int, kSteps> kStepColumns{1, 1, 0, -1, -1, -1, 0, 1};
inline constexpr std::array<int, kSteps> kStepRows{0, 1, 1, 1, 0, -1, -1, -1};

/// Traversable cells, their cost factors, and the exact distance to obstacles. The risk of a cell
/// is
///   max over cells c of  p(c) - (distance between centres / risk_radius)^2,  at least 0,
/// a dilation of the probabilities by a parabola (Felzenszwalb & Huttenlocher 2012, the distance
/// transform of a sampled function).
class PlanningGrid {
 public:
  /// `occupancy`: a probability per cell, NaN where unknown. Throws Error if their number differs
  /// from the number of cells, if one is outside [0, 1], or if an option is wrong.
  PlanningGrid(const GridGeometry& geometry, std::span<const double> occupancy,
               const PlanningGridOptions& options = {});

  const GridGeometry& geometry() const { return geometry_; }
  const PlanningGridOptions& options() const { return options_; }
  /// Whether a path may lead through a cell's centre; false outside the grid.
  bool traversable(const Cell& cell) const;
  /// Whether a cell's probability reaches `occupied_threshold`.
  bool obstacle(std::size_t index) const { return obstacle_[index] != 0; }
  /// Bit k: step k leads from the cell to a traversable cell; a diagonal step also needs both cells
  /// beside it traversable. 0 for cells that are not traversable.
  std::uint8_t steps(std::size_t index) const { return steps_[index]; }
  /// Cost per length in a cell, >= 1.
  double cost_factor(std::size_t index) const { return cost_factor_[index]; }
  /// Least and greatest factor of all traversable cells (1 when there is none).
  double least_cost_factor() const { return least_cost_factor_; }
  double greatest_cost_factor() const { return greatest_cost_factor_; }
  /// Distance of a cell's centre from the nearest obstacle (the square of its cell) or closed
  /// border, m; infinity without either.
  double clearance(std::size_t index) const { return clearance_[index]; }

  /// The same grid with another lethal radius, m.
  PlanningGrid with_lethal_radius(double radius) const;

  /// Whether all obstacles, and everything beyond a closed border, are at least `radius` away from
  /// a point. A disc of radius 0 is free where its cell is no obstacle. Exact.
  bool disc_is_free(const Eigen::Vector2d& center, double radius) const;
  /// The point of an obstacle or of a closed border that is nearest to `point`, unless it is
  /// farther than `farthest` m; `point` itself within obstacles.
  std::optional<Eigen::Vector2d> nearest_obstacle(const Eigen::Vector2d& point,
                                                  double farthest) const;
  /// Whether the vehicle can stand at a pose: all discs of its footprint are free, and its
  /// reference point lies on the map.
  bool is_free(const VehicleFootprint& footprint, const PlanarPose& pose) const;
  /// [discs] depth of each disc of the vehicle's footprint in obstacles, m: 0 where it touches
  /// none, at most its radius.
  std::vector<double> overlaps(const VehicleFootprint& footprint, const PlanarPose& pose) const;
  /// Integral of the cost factor along a straight line, m. It is infinity where the line leaves the
  /// grid or passes through a cell that is not traversable (at a corner, both cells beside it
  /// count).
  double line_cost(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const;

 private:
  void measure_clearance();
  void find_steps();
  bool is_traversable(int column, int row) const;
  bool reaches_obstacle(const Eigen::Vector2d& center, double radius) const;
  void set_cost_factors(std::span<const double> occupancy);

  GridGeometry geometry_;
  PlanningGridOptions options_;
  std::vector<std::uint8_t> obstacle_, traversable_, steps_;  ///< [cell]
  std::vector<float> clearance_, cost_factor_;                ///< [cell]
  double least_cost_factor_ = 1, greatest_cost_factor_ = 1;
};

}  // namespace blindcorner
