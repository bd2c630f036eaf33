// SPDX-License-Identifier: Apache-2.0
/// From optima to a posterior: Fisher information, evidences, importance sampling.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "blindcorner/forward/scene/pose_mixture.h"
#include "blindcorner/inverse/fit.h"
#include "inverse/posterior/importance.h"
#include "inverse/search/refine.h"
#include "inverse/search/scoring.h"

namespace blindcorner {

/// Expected Fisher information at an optimum, linear unknowns eliminated by the Schur complement;
/// pose priors not included. sum (dm/dtheta)(dm/dtheta)' / variance over bins.
struct Information {
  Eigen::MatrixXd pose;         ///< [n, n]
  Eigen::MatrixXd pose_sensor;  ///< [n, 6] with the sensor pose; empty without moved models
};

/// Models compiled with the sensor moved by +-step along each of x, y, z (m) and turned about each
/// world axis (rad).
struct MovedModels {
  std::array<ModelSet, 6> plus, minus;
  std::array<double, 6> step{};
};

Information information(const PoseObjective& objective, const Refined& optimum,
                        const MovedModels* moved = nullptr);

/// Which linear unknowns (amplitude, ambient, direct) a zone has for itself.
struct OwnUnknowns {
  bool amplitude, ambient, direct;

  OwnUnknowns(const LinearUnknowns& unknowns, const ZoneShapes& shapes);
};

/// Completes the information [3, 3] of a zone's own linear unknowns from the bins of its window:
/// adds the bins outside of it and the priors, and makes those that it does not have neutral.
void complete_own_information(const ObservedZone& zone, const BinLikelihood& law,
                              const LinearUnknowns& unknowns, const OwnUnknowns& own,
                              double ambient, Eigen::Matrix3d& information);

/// Mean and covariance of a mixture from its modes, whose weights sum to one; circular unknowns
/// are unrolled about the first mode.
void set_moments(const Scene& scene, PoseMixture& mixture);

/// Deviance at an optimum against its expectation for counts as small as these are.
GoodnessOfFit goodness_of_fit(const PoseObjective& objective, const Refined& optimum);

struct PosteriorOptions {
  double negligible = 12.0;
  int samples = 256;       ///< of the importance sampler; 0: Laplace everywhere
  double inflation = 1.0;  ///< of covariances and of the information, from the goodness of fit
  std::uint64_t seed = 1;
};

struct Posterior {
  PoseMixture mixture;      ///< presence_probability not filled in
  double log_evidence = 0;  ///< log integral of likelihood times priors over all unknowns
  bool sampled = false;     ///< importance sampling replaced Laplace's approximation
  double effective_samples = 0;
  /// The best samples that lie apart from every optimum that was found and are about as good: each
  /// may stand in a basin that was missed.
  std::vector<PoseVector> promising;
};

/// Modes with weights, means and covariances from refined optima (best first, duplicates merged).
/// Laplace's approximation is kept where the posterior at the sigma points agrees with it;
/// elsewhere (bounds, flat directions, skew, overlapping modes) the posterior is sampled. Optima
/// with no valley between them are one mode. Without `scored`, Laplace everywhere, one mode each.
Posterior posterior(const PoseObjective& objective, const std::vector<Refined>& optima,
                    const Scored* scored, const MovedModels* moved,
                    const PosteriorOptions& options);

/// Groups optima (best first) with no valley between them: along a way from one to the other,
/// straight or bent along a curved ridge, the log posterior falls less than one below the lower
/// end. Returns for each the index of its group's
/// best.
std::vector<std::size_t> connect(const PoseObjective& objective,
                                 const std::vector<const Refined*>& optima, double inflation);

}  // namespace blindcorner
