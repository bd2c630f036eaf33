// SPDX-License-Identifier: Apache-2.0
/// The true world of a drive: walls, hidden objects that may move, and the vehicle's place compared
/// with the place that it believes in.
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
  /// Draws what the drive file leaves open. The same seed gives the same truth. `speed`: wanted
  /// speed, m/s, instead of the drive file's.
  TrueWorld(const Drive& drive, std::uint64_t seed, std::optional<double> speed = std::nullopt);

  /// Where the vehicle starts, m.
  Eigen::Vector2d vehicle_start() const;

  /// The hidden objects' true pose at a time, s; empty: there are none.
  std::optional<PoseVector> hidden(double time) const;
  /// The same pose as placements; empty without hidden objects.
  std::vector<Placement> placements(double time) const;

  /// The state that the vehicle believes in. It is off by the same offset and turn for the whole
  /// drive.
  VehicleState believed(const VehicleState& truth) const;
  /// Where a vehicle in the state `truth` would place the hidden objects, if it sees them without
  /// error.
  std::optional<PoseVector> believed_hidden(const VehicleState& truth, double time) const;

  /// Wanted speed of this drive, m/s.
  double speed() const { return speed_; }
  /// [objects] m/s
  const std::vector<Eigen::Vector2d>& velocity() const { return velocity_; }

  /// Corners (m), seen from above, of the known surfaces that stand in the vehicle's way. These
  /// surfaces reach into the heights between a kerb and the vehicle's roof.
  const std::vector<std::vector<Eigen::Vector2d>>& walls() const { return walls_; }
  /// Cells of the drive's map whose circumcircle a wall reaches into.
  std::vector<Cell> wall_cells() const;
  /// Outlines of the hidden objects at a time, s; corners in m.
  std::vector<std::vector<Eigen::Vector2d>> bodies(double time) const;

  /// Distance of a convex outline (corners, m) to the nearest wall or body; 0 if the outline
  /// touches one.
  double clearance(const std::vector<Eigen::Vector2d>& outline, double time) const;
  /// The name of the hidden object, or else of the wall, that the outline touches; empty: none.
  std::string touched(const std::vector<Eigen::Vector2d>& outline, double time) const;

 private:
  const Drive& drive_;
  PoseVector start_;
  std::vector<Eigen::Vector2d> velocity_;  ///< [objects] m/s
  double speed_ = 0;
  bool present_ = true;
  Eigen::Vector2d offset_ = Eigen::Vector2d::Zero();  ///< error of the vehicle's believed place, m
  double turn_ = 0;                                   ///< error of the vehicle's believed yaw, rad
  std::vector<std::vector<Eigen::Vector2d>> walls_;
  std::vector<std::string> wall_names_;  ///< [walls]
};

}  // namespace blindcorner
