// SPDX-License-Identifier: Apache-2.0
/// Pulses far narrower than a bin.
#pragma once

#include <algorithm>
#include <cmath>

#include "blindcorner/forward/sensor/impulse_response.h"

namespace blindcorner {

/// Standard deviation of the narrowest pulse, in bins. Narrower pulses are widened to it, so that
/// tables and grids of finite steps stay smooth and positive. The widening moves light to a
/// neighbouring bin only within about two of these standard deviations of the edge between the
/// bins. It does not change the sum of the light.
inline constexpr double kMinPulseBins = 1.0 / 32;

/// Extra variance, s^2, that widens a pulse to kMinPulseBins; 0 for wider pulses.
inline double least_pulse_blur(const ImpulseResponse& response, double bin_width) {
  const double least = kMinPulseBins * bin_width;
  return std::max(std::pow(least, 2) - std::pow(response.core_sigma(), 2), 0.0);
}

}  // namespace blindcorner
