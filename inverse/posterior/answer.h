// SPDX-License-Identifier: Apache-2.0
/// What a fit answers beside the posterior of its optima: darkness, disturbed captures, flags.
#pragma once

#include <span>

#include "blindcorner/inverse/fit.h"
#include "inverse/posterior/posterior.h"

namespace blindcorner {

/// Whether photons are counted and there is none.
bool no_photons(const Observation& observation);

/// The answer to captures without a single photon: the prior, and how likely darkness is.
void answer_darkness(const CompiledScene& compiled, const Observation& observation,
                     std::span<const Capture> captures, FitResult& result);

/// Mixes the prior into mean and covariance of the whole posterior, for captures that something
/// unknown has disturbed: no small covariance may come of a capture that the model does not
/// explain.
void allow_for_outliers(const Scene& scene, PoseMixture& mixture);

/// Flags what is odd about an answer; `left_over` as of UnexplainedLight::probability().
void set_flags(const Scene& scene, const Posterior& posterior, double left_over, FitResult& result);

}  // namespace blindcorner
