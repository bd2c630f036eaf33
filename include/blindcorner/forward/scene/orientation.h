// SPDX-License-Identifier: Apache-2.0
/// Rotations as yaw, pitch and roll.
#pragma once

#include <Eigen/Geometry>
#include <cmath>

namespace blindcorner {

/// Rotation by yaw, pitch and roll, rad: about z, then the new y, then the new x. Positive pitch
/// looks down.
inline Eigen::Matrix3d rotation_of(const Eigen::Vector3d& yaw_pitch_roll) {
  return Eigen::AngleAxisd(yaw_pitch_roll[0], Eigen::Vector3d::UnitZ()).toRotationMatrix() *
         Eigen::AngleAxisd(yaw_pitch_roll[1], Eigen::Vector3d::UnitY()).toRotationMatrix() *
         Eigen::AngleAxisd(yaw_pitch_roll[2], Eigen::Vector3d::UnitX()).toRotationMatrix();
}

/// The inverse of rotation_of(); pitch is within +-pi/2. Straight up or down, yaw and roll turn
/// about the same axis: the whole turn is then returned as yaw.
inline Eigen::Vector3d yaw_pitch_roll_of(const Eigen::Matrix3d& rotation) {
  const double cosine = std::hypot(rotation(0, 0), rotation(1, 0));
  const double pitch = std::atan2(-rotation(2, 0), cosine);
  if (cosine < 1e-9) return {std::atan2(-rotation(0, 1), rotation(1, 1)), pitch, 0.0};
  return {std::atan2(rotation(1, 0), rotation(0, 0)), pitch,
          std::atan2(rotation(2, 1), rotation(2, 2))};
}

}  // namespace blindcorner
