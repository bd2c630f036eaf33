// SPDX-License-Identifier: Apache-2.0
/// What is really there on a drive: walls, and hidden objects that may move.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "blindcorner/io/drive_file.h"

namespace blindcorner {

class TrueWorld {
 public:
  /// Draws what the drive file leaves open; the same seed gives the same truth.
  TrueWorld(const Drive& drive, std::uint64_t seed);

  /// The hidden objects' true pose at a time, s; empty: there are none.
  std::optional<PoseVector> hidden(double time) const;
  /// The same as placements; none without hidden objects.
  std::vector<Placement> placements(double time) const;

  /// Wanted speed of this drive, m/s.
  double speed() const { return speed_; }

  /// Corners (m) of the known surfaces that stand in the vehicle's way, seen from above: what
  /// reaches into the heights between a kerb and the vehicle's roof.
  const std::vector<std::vector<Eigen::Vector2d>>& walls() const { return walls_; }
  /// Of the hidden objects.
  std::vector<std::vector<Eigen::Vector2d>> bodies(double time) const;

  /// Distance of a convex outline (corners, m) to the nearest wall or body; 0 where it touches one.
  double clearance(const std::vector<Eigen::Vector2d>& outline, double time) const;

 private:
  const Drive& drive_;
  PoseVector start_;
  double speed_ = 0;
  bool present_ = true;
  std::vector<std::vector<Eigen::Vector2d>> walls_;
};

}  // namespace blindcorner
