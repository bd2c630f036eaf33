// SPDX-License-Identifier: Apache-2.0
/// Nonlinear least squares from one start: on the models, or on a cheaper light as these correct
/// it.
#pragma once

#include <optional>
#include <vector>

#include "inverse/likelihood/pose_objective.h"

namespace blindcorner {

struct Refined {
  PoseVector pose;
  PoseValue value;
  LinearSolution linear;
  /// What the spline lacks at the pose or, where the objective's models are better ones than the
  /// rough ones, what the rough ones lack; else empty.
  Correction correction;
  Eigen::MatrixXd slope;  ///< [rows, n] the model's at or near the pose; empty if not asked for
  int evaluations = 0;
  bool converged = false;
};

/// Where a descent starts. An unknown may be held first: the others follow it before it moves.
struct Start {
  PoseVector pose;
  std::optional<int> held_first = std::nullopt;
};

/// Where an unknown is in the search region: -1 at its lower bound, 1 at its upper one, else 0.
int bound_at(const Scene& scene, const PoseVector& pose, Eigen::Index unknown);

/// Minimises the deviance from `start` with Ceres (Levenberg-Marquardt, bounds, forward
/// differences in steps of CompiledScene::step), to tell basins apart: on the spline through the
/// scored poses where there is one (the value is its), else on the objective's models, for measured
/// laws on the ladder's cheap ones (the value is theirs).
Refined approach(const PoseObjective& objective, const Start& start);

/// The same from several places, side by side.
std::vector<Refined> approach_all(const PoseObjective& objective, const std::vector<Start>& starts);

/// With the objective's models, from a start in the right basin: a spline gives the derivatives and
/// the models the residuals; without one, both are the models'.
Refined polish(const PoseObjective& objective, const PoseVector& start);

/// Leaves out what is on the slopes of the best one's peak; `optima` best first. Where descents go
/// to their ends at once, on splines and for measured laws, all stay.
std::vector<Refined> without_slopes(const PoseObjective& objective, std::vector<Refined> optima);

/// Optima from starts in the right basins, and `optima` that are known already: polished and
/// merged, best first; without those on the slopes of the best one's peak, where optima are settled
/// later.
std::vector<Refined> polish_all(const PoseObjective& objective,
                                const std::vector<PoseVector>& starts, double negligible,
                                std::vector<Refined> optima = {});

/// Those that may matter brought to the end of their descents, with the light's slopes there, and
/// merged; not on splines, nor for measured laws.
std::vector<Refined> settle_all(const PoseObjective& objective, std::vector<Refined> optima,
                                double negligible);

/// Both.
std::vector<Refined> find_optima(const PoseObjective& objective,
                                 const std::vector<PoseVector>& starts, double negligible,
                                 std::vector<Refined> optima = {});

/// Moves an optimum to where the objective's models have it, by least squares on these, or on the
/// rough ones as these correct them. `here`: the models' light at its pose, where that is known.
/// Values at the end are those of lights that were corrected less than two standard deviations off.
void settle(const PoseObjective& objective, Refined& optimum, const ShapeBuffer* here = nullptr);

/// The light at and near a refined pose: the models', or the cheaper light that these correct
/// there.
LightSource light_near(const PoseObjective& objective, const Refined& refined);

}  // namespace blindcorner
