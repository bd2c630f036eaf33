// SPDX-License-Identifier: Apache-2.0
/// Does the model explain the capture to its noise?
#pragma once

#include "blindcorner/inverse/fit.h"
#include "inverse/search/refine.h"

namespace blindcorner {

/// Deviance at an optimum against its expectation for counts as small as these are.
GoodnessOfFit goodness_of_fit(const PoseObjective& objective, const Refined& optimum);

/// What the counts miss of the log likelihood that is expected at a right optimum.
double missed_log_likelihood(const PoseObjective& objective, const Refined& optimum);

/// Factor on covariances for another deviance of the same counts.
double inflation(const GoodnessOfFit& fit, double deviance);

}  // namespace blindcorner
