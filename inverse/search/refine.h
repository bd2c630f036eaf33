// SPDX-License-Identifier: Apache-2.0
/// Nonlinear least squares from one start, on the models or on a cheaper light that the models
/// correct.
#pragma once

#include <optional>
#include <vector>

#include "inverse/likelihood/pose_objective.h"

namespace blindcorner {

struct Refined {
  PoseVector pose;
  PoseValue value;
  LinearSolution linear;
  /// What the cheaper light lacks at the pose: the spline or, where the objective's models are
  /// finer than its rough ones, the rough models. Else empty.
  Correction correction;
  /// [rows, n] Slopes of the model's light at or near the pose; empty if nobody asked for them.
  Eigen::MatrixXd slope;
  int evaluations = 0;
  bool converged = false;
};

/// Where a descent starts. One unknown may be held at first: the others follow before it moves.
struct Start {
  PoseVector pose;
  std::optional<int> held_first = std::nullopt;
};

/// Where an unknown is in the search region: -1 at its lower bound, 1 at its upper one, else 0.
int bound_at(const Scene& scene, const PoseVector& pose, Eigen::Index unknown);

/// Minimises the deviance from `start` with Ceres (Levenberg-Marquardt, bounds, forward differences
/// in steps of CompiledScene::step), to tell basins apart. The light, which also gives the value,
/// is that of the spline through the scored poses where there is one, else that of the objective's
/// models. Without closed form (measured laws), it is that of the ladder's cheap models.
Refined approach(const PoseObjective& objective, const Start& start);

/// approach() from several starts in parallel.
std::vector<Refined> approach_all(const PoseObjective& objective, const std::vector<Start>& starts);

/// Descends on the objective's models from a start in the right basin. Where there is a spline, it
/// gives the derivatives and the models give the residuals; else the models give both. Where poses
/// are scored in closed form, this is approach(), and settle() ends the descent later.
Refined polish(const PoseObjective& objective, const PoseVector& start);

/// Leaves out optima on the slopes of the best one's peak. `optima` are sorted best first. On
/// splines and for measured laws, descents go to their ends at once, and all optima stay.
std::vector<Refined> without_slopes(const PoseObjective& objective, std::vector<Refined> optima);

/// Polishes starts in the right basins and merges the results with `optima`, which are known
/// already; best first. Where optima are settled later, those on the slopes of the best one's peak
/// are left out.
std::vector<Refined> polish_all(const PoseObjective& objective,
                                const std::vector<PoseVector>& starts, double negligible,
                                std::vector<Refined> optima = {});

/// Brings the optima that may matter to the end of their descents, takes the light's slopes there,
/// and merges the optima. Does nothing on splines and for measured laws.
std::vector<Refined> settle_all(const PoseObjective& objective, std::vector<Refined> optima,
                                double negligible);

/// polish_all(), then settle_all().
std::vector<Refined> find_optima(const PoseObjective& objective,
                                 const std::vector<PoseVector>& starts, double negligible,
                                 std::vector<Refined> optima = {});

/// Moves an optimum to where the objective's models have it, by least squares on these or on the
/// rough models that they correct. After a move of two standard deviations or more, the rough
/// models are corrected anew and the optimum moves again, up to kMaxMoves times. `here` is the
/// models' light at the optimum's pose, or null if it is not known.
void settle(const PoseObjective& objective, Refined& optimum, const ShapeBuffer* here = nullptr);

/// The light at and near a refined pose: that of the models, or the cheaper light that the models
/// correct at the pose.
LightSource light_near(const PoseObjective& objective, const Refined& refined);

}  // namespace blindcorner
