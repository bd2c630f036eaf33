// SPDX-License-Identifier: Apache-2.0
/// Mean and variance of what is known of a pose before any capture.
#pragma once

#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

struct PriorMoments {
  double mean = 0;  ///< m, rad or 1; on a circle any value serves, and this is the range's middle
  double variance = 0;  ///< of the same unit, squared
};

/// Moments of an unknown's prior: uniform over its range (on a circle, over one period), times the
/// normal prior if there is one. Of all normal densities, the one with these moments is closest to
/// the prior.
PriorMoments prior_moments(const Scene& scene, std::size_t unknown);

/// [n, n] Inverse variances of all unknowns' priors.
Eigen::MatrixXd prior_precision(const Scene& scene);

}  // namespace blindcorner
