// SPDX-License-Identifier: Apache-2.0
/// The static background's own error, carried in the likelihood and not charged to the object.
#pragma once

#include <span>

#include "inverse/likelihood/pose_objective.h"

namespace blindcorner {

/// Gives each bin the share of the photon noise in all that it may be off by as its weight. `empty`
/// is the scene without an object. Where the error is negligible in all bins they keep none.
void weigh(const CompiledScene& compiled, const LinearSolution& empty, Observation& observation);

/// Captures cut to the compiled scene's gates, weighed by their own fit without an object.
Observation observe(const CompiledScene& compiled, std::span<const Capture> captures);

}  // namespace blindcorner
