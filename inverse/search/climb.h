// SPDX-License-Identifier: Apache-2.0
/// Maximising a log posterior along some directions of the pose, the others held.
#pragma once

#include <Eigen/Core>
#include <functional>

#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

/// Log posterior at a pose; -infinity outside of the prior.
using LogTarget = std::function<double(const PoseVector&)>;

struct Climbed {
  PoseVector pose;
  double target = 0;
  double moved = 0;  ///< length of all steps, standard deviations
};

/// The highest place that is reached from a pose of finite target along `directions` [n, m], each
/// one standard deviation long, by at most so many quasi-Newton steps (Broyden, Fletcher, Goldfarb,
/// Shanno) from slopes that are one-sided differences. `inverse` [m, m]: of the curvature, in units
/// of the directions; identity says that they are right, and what is learned is left in it.
Climbed climb(Climbed from, const Eigen::MatrixXd& directions, const LogTarget& target, int steps,
              Eigen::MatrixXd& inverse);

}  // namespace blindcorner
