// SPDX-License-Identifier: Apache-2.0
/// From optima to a posterior: evidences by Laplace's method, importance sampling where that fails.
#pragma once

#include <cstdint>
#include <vector>

#include "blindcorner/forward/scene/pose_mixture.h"
#include "inverse/posterior/fisher_information.h"
#include "inverse/search/refine.h"
#include "inverse/search/scoring.h"

namespace blindcorner {

/// Weight of the heaviest mode below which a result is called multimodal. By judgement: the other
/// modes then hold the truth in one of ten captures or more.
inline constexpr double kOneMode = 0.9;

/// Sets the mean and covariance of a mixture from its modes, whose weights sum to one. Circular
/// unknowns are unrolled about the first mode.
void set_moments(const Scene& scene, PoseMixture& mixture);

struct PosteriorOptions {
  /// Modes with less than exp(-negligible) of the weight are dropped, as by
  /// FitOptions::negligible_log_posterior.
  double negligible = 12.0;
  int samples = 256;       ///< of the importance sampler, as a fit's; 0: Laplace everywhere
  double inflation = 1.0;  ///< of covariances and of the information, from the goodness of fit
  std::uint64_t seed = 1;
  Eigen::MatrixXd model_error;  ///< [n, n] added to modes' covariances; empty: none
  /// Whether the rules of these names apply, see FitRule.
  bool along_axis = true, ridges = true, local_light = true;
};

struct Posterior {
  PoseMixture mixture;      ///< presence_probability not filled in
  double log_evidence = 0;  ///< log integral of likelihood times priors over all unknowns
  bool sampled = false;     ///< importance sampling replaced Laplace's approximation
  double effective_samples = 0;
};

/// Modes with weights, means and covariances from refined optima (best first, duplicates merged).
/// Laplace's approximation is kept where the posterior agrees with it at the sigma points of all
/// modes that matter. Their moments are then corrected by the posterior at these points. Otherwise
/// (bounds, flat directions, skew, overlapping modes) the posterior is sampled, and optima with no
/// valley between them become one mode. Without `scored`, Laplace's approximation is used
/// everywhere, and each optimum is a mode.
Posterior posterior(const PoseObjective& objective, const std::vector<Refined>& optima,
                    const Scored* scored, const MovedModels* moved,
                    const PosteriorOptions& options);

}  // namespace blindcorner
