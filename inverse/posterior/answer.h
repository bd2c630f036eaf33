// SPDX-License-Identifier: Apache-2.0
/// What a fit answers beside the posterior of its optima: darkness, disturbed captures, flags.
#pragma once

#include <span>

#include "blindcorner/inverse/fit.h"
#include "inverse/posterior/posterior.h"

namespace blindcorner {

/// Whether the noise model counts photons and the captures hold none.
bool no_photons(const Observation& observation);

/// The answer to captures without a single photon: the prior of the pose, and the probability of
/// presence that such darkness leaves.
void answer_darkness(const CompiledScene& compiled, const Observation& observation,
                     std::span<const Capture> captures, FitResult& result);

/// Mixes the prior into the mean and covariance of the whole posterior, because something unknown
/// may have disturbed the captures. A capture that the model does not explain must not lead to a
/// small covariance.
void allow_for_outliers(const Scene& scene, PoseMixture& mixture);

/// Flags what is odd about an answer. `left_over` is UnexplainedLight::probability().
void set_flags(const Scene& scene, const Posterior& posterior, double left_over, FitResult& result);

}  // namespace blindcorner
