// SPDX-License-Identifier: Apache-2.0
/// What a calibration found out, as a page and as text.
#pragma once

#include <string>

#include "blindcorner/inverse/calibration/calibration.h"

namespace blindcorner {

/// Measured histograms beside those of the model before and after, and all parameters.
std::string calibration_page(const Scene& before, const Calibration& calibration);

/// The same as text for a terminal, without the histograms.
std::string calibration_text(const Calibration& calibration);

}  // namespace blindcorner
