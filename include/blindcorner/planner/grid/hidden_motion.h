// SPDX-License-Identifier: Apache-2.0
/// Where hidden objects may have gone since they were last measured.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "blindcorner/forward/scene/motion.h"
#include "blindcorner/forward/scene/pose_mixture.h"
#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

/// Velocity of a mode's pose, in the order of the scene's unknowns; zeros for all but x and y.
struct PoseVelocity {
  Eigen::VectorXd mean;        ///< [n] m/s
  Eigen::MatrixXd covariance;  ///< [n, n] m^2/s^2
  /// [n, n] Cov(pose, velocity): row of a pose's component, column of a velocity's. What a track
  /// that runs ahead has taken for too fast, it has taken for too far as well.
  Eigen::MatrixXd with_pose;
};

/// Moves an answer on in time: nearly constant velocity, as the tracker predicts (tracker.h).
class HiddenMotion {
 public:
  /// `dwell_time` in s: mean time that an object stays.
  HiddenMotion(const Scene& scene, const Motion& motion, double dwell_time);

  /// The mixture `age` seconds after the capture that it is about. Means move by v t; covariances P
  /// become P + t (W + W') + t^2 V, W = Cov(pose, v), V = Cov(v) (Bar-Shalom, Li & Kirubarajan
  /// 2001, 6.2.2), those of x and y grow by q t^3 / 3 more, of all else by drift^2 t. The
  /// probability that the object is still there falls by exp(-t / dwell time); the rest is the
  /// scene's prior, as weights that sum to less than one say (pose_spread.h). `velocities` are per
  /// mode; empty: mean 0 and Motion::initial_speed along each axis. Throws Error for a negative or
  /// infinite age, and for modes or velocities that are not as many as they should be.
  PoseMixture predicted(const PoseMixture& mixture, double age,
                        const std::vector<PoseVelocity>& velocities = {}) const;

  /// Of an object of which no more is known than Motion::initial_speed.
  PoseVelocity any_velocity() const;

 private:
  void move(const PoseVelocity& velocity, double age, PoseMode& mode) const;

  std::vector<Unknown> unknowns_;
  double presence_prior_ = 0;
  Motion motion_;
  double dwell_time_ = 0;
};

}  // namespace blindcorner
