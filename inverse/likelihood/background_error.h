// SPDX-License-Identifier: Apache-2.0
/// The static background's own error, carried in the likelihood and not charged to the object.
#pragma once

#include <span>

#include "inverse/likelihood/pose_objective.h"

namespace blindcorner {

/// Sets each bin's weight: the photon variance over the sum of photon variance and the background's
/// own error variance. `empty` is the fit without an object. Where the error is negligible in all
/// bins, the bins get no weights.
void weigh(const CompiledScene& compiled, const LinearSolution& empty, Observation& observation);

/// Cuts captures to the compiled scene's gates and weighs them by their own fit without an object.
Observation observe(const CompiledScene& compiled, std::span<const Capture> captures);

}  // namespace blindcorner
