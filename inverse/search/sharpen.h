// SPDX-License-Identifier: Apache-2.0
/// How exact a model has to be follows from the capture: its error must be small against the photon
/// noise of what is fitted.
#pragma once

#include <string>
#include <vector>

#include "inverse/search/refine.h"

namespace blindcorner {

/// Relative error (L2) of the light of the models of a level, at most (of the shipped scenes).
double light_error(const Scene& scene, int level);

/// What is left of the model's error.
struct ModelError {
  Eigen::MatrixXd covariance;  ///< [n, n] of the pose
  int level = 0;               ///< of the models that decided, CompiledScene::models_at()
  bool too_dear = false;       ///< the next one was asked for and costs too much
};

/// The sentence that says so.
std::string too_dear_hint();

/// Goes to tighter models for as long as the next one moves the best optimum by a noticeable part
/// of its standard deviation: the objective then uses them, and the optima are moved to where they
/// have them. Where the next one shows that the one in use says too much about the pose, it becomes
/// the rough model as well. The covariance is that of the last move, of which a
/// part is left to the models after it; where there are none, and that part is not small beside the
/// photon noise, it may lead anywhere. So may all that a worse model's light may lack where the
/// next one costs too much.
ModelError sharpen(PoseObjective& objective, std::vector<Refined>& optima, double negligible);

/// Lets the hidden objects stand in the way of the known scene's later bounces, where that changes
/// the best optimum: each optimum is weighed in the shadow that it casts itself, that of the best
/// one is taken off the background for all of them, and they are moved, until it hardly changes
/// any more. Returns the covariance, [n, n], of what the shadow's own sampling may move.
Eigen::MatrixXd cast_shadow(PoseObjective& objective, std::vector<Refined>& optima,
                            double negligible);

}  // namespace blindcorner
