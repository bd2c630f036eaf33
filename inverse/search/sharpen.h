// SPDX-License-Identifier: Apache-2.0
/// How exact a model has to be follows from the capture: its error must be small against the photon
/// noise of what is fitted.
#pragma once

#include <string>
#include <vector>

#include "inverse/search/refine.h"

namespace blindcorner {

/// Largest relative error (L2) of a level's light on the shipped scenes.
double light_error(const Scene& scene, int level);

/// What is left of the model's error.
struct ModelError {
  Eigen::MatrixXd covariance;  ///< [n, n] of the pose
  int level = 0;               ///< level of the models that decided, CompiledScene::models_at()
  bool too_dear = false;       ///< the next level is needed and costs too much
};

/// The hint for the user that a finer model costs too much.
std::string too_dear_hint();

/// Switches to finer models for as long as the next level moves the best optimum by a noticeable
/// part of its standard deviation. The objective then uses the finer models, and the optima move to
/// where these have them. Where the next level shows that the models in use overstate the
/// information about the pose, it replaces the rough models as well. The returned covariance is
/// that of the part of the last move by which further levels may still move the optimum. If there
/// is no further level and that part is not small beside the photon noise, the covariance also
/// allows for a move in any direction. If the next level costs too much, it allows for the whole
/// error of the light in use, in any direction.
ModelError sharpen(PoseObjective& objective, std::vector<Refined>& optima, double negligible);

/// Lets the hidden objects block the known scene's later bounces, where that moves the best
/// optimum. Each optimum is evaluated in the shadow that it casts itself. Then the best one's
/// shadow is taken off the background for all optima, and they are moved. This is repeated until
/// the shadow's change hardly moves the best optimum. Returns the covariance, [n, n], of the moves
/// that the error of the shadow's own sampling may cause.
Eigen::MatrixXd cast_shadow(PoseObjective& objective, std::vector<Refined>& optima,
                            double negligible);

}  // namespace blindcorner
