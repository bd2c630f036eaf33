// SPDX-License-Identifier: Apache-2.0
/// Where hidden objects may have gone since they were last measured.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "blindcorner/forward/scene/motion.h"
#include "blindcorner/forward/scene/pose_mixture.h"
#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

/// Velocity over the ground with its covariance.
struct PlanarVelocity {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();        ///< m/s
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  ///< m^2/s^2
};

/// Moves an answer on in time: nearly constant velocity, as the tracker predicts (tracker.h).
class HiddenMotion {
 public:
  /// `dwell_time` in s: mean time that an object stays.
  HiddenMotion(const Scene& scene, const Motion& motion, double dwell_time);

  /// The mixture `age` seconds after the capture that it is about. Means move by v t; covariances
  /// of x and y grow by Cov(v) t^2 + q t^3 / 3, of all else by drift^2 t. The probability that
  /// the object is still there falls by exp(-t / dwell time); the rest is the scene's prior, as
  /// weights that sum to less than one say (pose_spread.h). `velocities` are per hidden object;
  /// empty: mean 0 and Motion::initial_speed along each axis. Throws Error for a negative or
  /// infinite age, and for modes or velocities that are not as many as the scene's.
  PoseMixture predicted(const PoseMixture& mixture, double age,
                        const std::vector<PlanarVelocity>& velocities = {}) const;

 private:
  void move(const std::vector<PlanarVelocity>& velocities, double age, PoseMode& mode) const;

  std::vector<Unknown> unknowns_;
  int objects_ = 0;
  double presence_prior_ = 0;
  Motion motion_;
  double dwell_time_ = 0;
};

}  // namespace blindcorner
