// SPDX-License-Identifier: Apache-2.0
/// The perception that fits the physical model to the histograms and tracks what it finds.
#pragma once

#include <memory>

#include "blindcorner/simulation/perception.h"

namespace blindcorner {

std::unique_ptr<Perception> make_solver_perception(const PerceptionSetup& setup);

}  // namespace blindcorner
