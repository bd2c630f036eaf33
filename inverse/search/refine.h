// SPDX-License-Identifier: Apache-2.0
/// Nonlinear least squares from one start, coarse pulse to fine.
#pragma once

#include <vector>

#include "inverse/likelihood/pose_objective.h"

namespace blindcorner {

struct Refined {
  PoseVector pose;
  PoseValue value;
  LinearSolution linear;
  /// [rows] What the spline lacks at the pose, from polish() where there is a spline; else empty.
  std::vector<double> correction;
  int evaluations = 0;
  bool converged = false;
};

/// Minimises the deviance from `start` with Ceres (Levenberg-Marquardt, bounds, forward
/// differences in steps of CompiledScene::step): on the spline through the scored poses where there
/// is one, else once for each cheap rung of the ladder, wide pulses first. The value is theirs.
Refined approach(const PoseObjective& objective, const PoseVector& start);

/// The same with the model of the wanted tolerance and central differences (forward ones stop up to
/// 0.1 in log posterior short), from a start in the right basin. Where there is a spline, it gives
/// the derivatives and the model the residuals.
Refined polish(const PoseObjective& objective, const PoseVector& start);

/// Optima from starts in the right basins, and `optima` that are known already: polished and
/// merged, best first.
std::vector<Refined> find_optima(const PoseObjective& objective,
                                 const std::vector<PoseVector>& starts, double negligible,
                                 std::vector<Refined> optima = {});

/// The light at and near a refined pose: the corrected spline where there is one, else the model.
LightSource light_near(const CompiledScene& compiled, const Refined& refined);

}  // namespace blindcorner
