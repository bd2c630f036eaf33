// SPDX-License-Identifier: Apache-2.0
/// Instrument files: the results of a calibration, as a patch of the scene.
#pragma once

#include <nlohmann/json.hpp>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/inverse/calibration/calibration.h"

namespace blindcorner {

inline constexpr const char* kInstrumentFormat = "blindcorner.instrument/1";

/// JSON of an instrument file, see docs/instrument.md. `before` is the scene that was calibrated.
nlohmann::ordered_json instrument_json(const Scene& before, const Calibration& calibration);

}  // namespace blindcorner
