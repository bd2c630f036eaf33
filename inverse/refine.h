// SPDX-License-Identifier: Apache-2.0
/// Nonlinear least squares from one start, coarse pulse to fine.
#pragma once

#include "pose_objective.h"

namespace blindcorner {

struct Refined {
  PoseVector pose;
  PoseValue value;
  LinearSolution linear;
  int evaluations = 0;
  bool converged = false;
};

/// Minimises the deviance from `start` with Ceres (Levenberg-Marquardt, bounds, central
/// differences in steps of CompiledScene::step): on the spline through the scored poses where there
/// is one, else once for each cheap rung of the ladder, wide pulses first. The value is theirs.
Refined approach(const PoseObjective& objective, const PoseVector& start);

/// The same with the model of the wanted tolerance, from a start in the right basin.
Refined polish(const PoseObjective& objective, const PoseVector& start);

}  // namespace blindcorner
