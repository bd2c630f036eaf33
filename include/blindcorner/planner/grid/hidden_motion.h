// SPDX-License-Identifier: Apache-2.0
/// Where hidden objects may have moved since they were last measured.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "blindcorner/forward/scene/motion.h"
#include "blindcorner/forward/scene/pose_mixture.h"
#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

/// Velocity of a mode's pose, in the order of the scene's unknowns; zero except for x and y.
struct PoseVelocity {
  Eigen::VectorXd mean;        ///< [n] m/s
  Eigen::MatrixXd covariance;  ///< [n, n] m^2/s^2
  /// [n, n] Cov(pose, velocity): one row per component of the pose, one column per component of the
  /// velocity. A track that runs ahead overestimates the velocity, and with it the position.
  Eigen::MatrixXd with_pose;
};

/// Predicts an answer forward in time with nearly constant velocity, as the tracker does
/// (tracker.h).
class HiddenMotion {
 public:
  /// `dwell_time` in s: mean time that an object stays. Throws Error unless it is positive.
  HiddenMotion(const Scene& scene, const Motion& motion, double dwell_time);

  /// The mixture `age` seconds after its capture. Means move by v t. Covariances P become
  /// P + t (W + W') + t^2 V, W = Cov(pose, v), V = Cov(v) (Bar-Shalom, Li & Kirubarajan 2001,
  /// 6.2.2). Those of x and y grow by a further q t^3 / 3, those of all other components by
  /// drift^2 t. The probability that the object is still there falls by exp(-t / dwell time). The
  /// rest goes to the scene's prior: the weights then sum to less than one (pose_spread.h).
  /// `velocities` holds one entry per mode; empty: mean 0 and Motion::initial_speed along each
  /// axis. Throws Error for a negative or infinite age, and for modes or velocities of the wrong
  /// number or size.
  PoseMixture predicted(const PoseMixture& mixture, double age,
                        const std::vector<PoseVelocity>& velocities = {}) const;

  /// Velocity of an object about which only Motion::initial_speed is known.
  PoseVelocity any_velocity() const;

 private:
  void move(const PoseVelocity& velocity, double age, PoseMode& mode) const;

  std::vector<Unknown> unknowns_;
  double presence_prior_ = 0;
  Motion motion_;
  double dwell_time_ = 0;
};

}  // namespace blindcorner
