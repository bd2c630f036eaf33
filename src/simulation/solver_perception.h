// SPDX-License-Identifier: Apache-2.0
/// The perception that fits the physical model to the histograms and tracks what it finds.
#pragma once

#include <memory>

#include "blindcorner/inverse/fit.h"
#include "blindcorner/simulation/perception.h"

namespace blindcorner {

/// A fitter that answers in time for a sensor that moves.
std::shared_ptr<const Fitter> make_timely_fitter(const Scene& scene);

std::unique_ptr<Perception> make_solver_perception(const PerceptionSetup& setup);

}  // namespace blindcorner
