// SPDX-License-Identifier: Apache-2.0
/// Does the model explain the capture down to its noise?
#pragma once

#include "blindcorner/inverse/fit.h"
#include "inverse/search/refine.h"

namespace blindcorner {

/// Deviance at an optimum against its expectation for the actual, possibly small, counts.
GoodnessOfFit goodness_of_fit(const PoseObjective& objective, const Refined& optimum);

/// Shortfall of the log likelihood at an optimum against its expectation at a right one, at least
/// 0.
double missed_log_likelihood(const PoseObjective& objective, const Refined& optimum);

/// Factor on covariances if the same counts have this `deviance`.
double inflation(const GoodnessOfFit& fit, double deviance);

}  // namespace blindcorner
