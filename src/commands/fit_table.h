// SPDX-License-Identifier: Apache-2.0
/// Results of a fit as text for a terminal.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/inverse/fit.h"

namespace blindcorner {

/// A row per capture, up to `max_rows`: heaviest mode with standard deviations, its weight, the
/// probability of presence and, where the truth is known, the distance to it; then a summary.
std::string fit_table(const Scene& scene, const std::vector<FitResult>& results,
                      std::size_t max_rows = 20);

/// "blindcorner: FILE [3]: reason" for each failed capture, up to `max_lines`; empty without any.
std::string failure_lines(const std::vector<FitResult>& results, std::size_t max_lines = 20);

}  // namespace blindcorner
