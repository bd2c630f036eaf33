// SPDX-License-Identifier: Apache-2.0
/// The rows of each theme; a new theme is a file and a line in stability.cpp.
#pragma once

#include <vector>

#include "stability/stability.h"

namespace blindcorner {

std::vector<StabilityRow> pulse_rows();
std::vector<StabilityRow> geometry_rows();
std::vector<StabilityRow> scale_rows();
std::vector<StabilityRow> photon_rows();
std::vector<StabilityRow> inference_rows();
std::vector<StabilityRow> bright_rows();
std::vector<StabilityRow> assumption_rows();
std::vector<StabilityRow> learning_rows();
std::vector<StabilityRow> driving_rows();

}  // namespace blindcorner
