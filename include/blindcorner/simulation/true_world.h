// SPDX-License-Identifier: Apache-2.0
/// What is really there on a drive: walls, hidden objects that may move, and where the vehicle is
/// against where it takes itself to be.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "blindcorner/io/drive_file.h"
#include "blindcorner/planner/vehicles/vehicle_state.h"

namespace blindcorner {

class TrueWorld {
 public:
  /// Draws what the drive file leaves open; the same seed gives the same truth. `speed`: wanted,
  /// m/s, instead of the drive file's.
  TrueWorld(const Drive& drive, std::uint64_t seed, std::optional<double> speed = std::nullopt);

  /// Where the vehicle starts, m.
  Eigen::Vector2d vehicle_start() const;

  /// The hidden objects' true pose at a time, s; empty: there are none.
  std::optional<PoseVector> hidden(double time) const;
  /// The same as placements; none without hidden objects.
  std::vector<Placement> placements(double time) const;

  /// Where the vehicle takes itself to be: off by the same place and turn for the whole drive.
  VehicleState believed(const VehicleState& truth) const;
  /// Where a vehicle that is there would place the hidden objects that it sees without error.
  std::optional<PoseVector> believed_hidden(const VehicleState& truth, double time) const;

  /// Wanted speed of this drive, m/s.
  double speed() const { return speed_; }
  /// [objects] m/s
  const std::vector<Eigen::Vector2d>& velocity() const { return velocity_; }

  /// Corners (m) of the known surfaces that stand in the vehicle's way, seen from above: what
  /// reaches into the heights between a kerb and the vehicle's roof.
  const std::vector<std::vector<Eigen::Vector2d>>& walls() const { return walls_; }
  /// Cells of the drive's map whose circumcircle a wall reaches into.
  std::vector<Cell> wall_cells() const;
  /// Of the hidden objects.
  std::vector<std::vector<Eigen::Vector2d>> bodies(double time) const;

  /// Distance of a convex outline (corners, m) to the nearest wall or body; 0 where it touches one.
  double clearance(const std::vector<Eigen::Vector2d>& outline, double time) const;
  /// The name of the hidden object, or else of the wall, that it touches; empty: none.
  std::string touched(const std::vector<Eigen::Vector2d>& outline, double time) const;

 private:
  const Drive& drive_;
  PoseVector start_;
  std::vector<Eigen::Vector2d> velocity_;  ///< [objects] m/s
  double speed_ = 0;
  bool present_ = true;
  Eigen::Vector2d offset_ = Eigen::Vector2d::Zero();  ///< of the vehicle's belief, m
  double turn_ = 0;                                   ///< of the vehicle's belief, rad
  std::vector<std::vector<Eigen::Vector2d>> walls_;
  std::vector<std::string> wall_names_;  ///< [walls]
};

}  // namespace blindcorner
