// SPDX-License-Identifier: Apache-2.0
/// Nonlinear least squares from one start: on a cheap light, on it as the model corrects it, on the
/// model.
#pragma once

#include <vector>

#include "inverse/likelihood/pose_objective.h"

namespace blindcorner {

struct Refined {
  PoseVector pose;
  PoseValue value;
  LinearSolution linear;
  Correction correction;  ///< what the steering light lacks at the pose; empty without one
  Eigen::MatrixXd slope;  ///< [rows, n] the model's at or near the pose; empty if not asked for
  int evaluations = 0;
  bool converged = false;
};

/// Where an unknown is in the search region: -1 at its lower bound, 1 at its upper one, else 0.
int bound_at(const Scene& scene, const PoseVector& pose, Eigen::Index unknown);

/// Where descents from `starts` end on closed-form light with widened pulses; without such light
/// the starts themselves.
std::vector<PoseVector> approach_widely(const PoseObjective& objective,
                                        const std::vector<PoseVector>& starts);

/// Minimises the deviance from `start` with Ceres (Levenberg-Marquardt, bounds, forward
/// differences in steps of CompiledScene::step): on the spline through the scored poses where there
/// is one (the value is its), else on closed-form light, wide pulses first (the value is the
/// model's), else on the ladder's cheap models (the value is theirs).
Refined approach(const PoseObjective& objective, const PoseVector& start);

/// The last part of that, from where approach_widely() ended: for those who follow only one of the
/// starts that end at the same place.
Refined approach_closely(const PoseObjective& objective, const PoseVector& place);

/// The same with the model of the wanted tolerance, from a start in the right basin: a steering
/// light gives the derivatives and the model the residuals; without one, both are the model's.
Refined polish(const PoseObjective& objective, const PoseVector& start);

/// Optima from starts in the right basins, and `optima` that are known already: polished and
/// merged, best first; without those on the slopes of the best one's peak, where optima are settled
/// later.
std::vector<Refined> polish_all(const PoseObjective& objective,
                                const std::vector<PoseVector>& starts, double negligible,
                                std::vector<Refined> optima = {});

/// The same from places where closed-form light is too rough to steer: by the model's own
/// derivatives.
std::vector<Refined> descend_all(const PoseObjective& objective,
                                 const std::vector<PoseVector>& places, double negligible,
                                 std::vector<Refined> optima);

/// Where closed-form light steered: those that may matter settled by the model's own derivatives,
/// and merged.
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

/// Optima from starts that are no known optima's, and `optima`. The compiled scene's own models
/// find them; the objective's, where these are better ones, then move them.
std::vector<Refined> find_more(const PoseObjective& objective, const Observation& observation,
                               const std::vector<PoseVector>& starts, double negligible,
                               std::vector<Refined> optima);

/// The light at and near a refined pose: the corrected steering light where there is one, else the
/// model.
LightSource light_near(const PoseObjective& objective, const Refined& refined);

}  // namespace blindcorner
