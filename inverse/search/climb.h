// SPDX-License-Identifier: Apache-2.0
/// Maximises a log posterior along some directions of the pose. The other directions are held.
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

/// Climbs from a pose with a finite target along `directions` [n, m], each one standard deviation
/// long, and returns the highest place that it reaches. It takes at most `steps` quasi-Newton steps
/// (Broyden, Fletcher, Goldfarb, Shanno); slopes are one-sided differences. `inverse` [m, m] is the
/// inverse curvature in units of the directions: the identity says that these are right. The steps
/// update it.
Climbed climb(Climbed from, const Eigen::MatrixXd& directions, const LogTarget& target, int steps,
              Eigen::MatrixXd& inverse);

}  // namespace blindcorner
