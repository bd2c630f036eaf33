// SPDX-License-Identifier: Apache-2.0
/// Pulses far narrower than a bin.
#pragma once

#include <algorithm>
#include <cmath>

#include "blindcorner/forward/sensor/impulse_response.h"

namespace blindcorner {

/// Narrowest pulse that is told apart, standard deviation in bins. Tables and grids of finite steps
/// stay smooth and positive with it; light moves to a neighbouring bin only within about two of
/// these of the edge between them, and its sum stays what it is.
inline constexpr double kMinPulseBins = 1.0 / 32;

/// Extra variance, s^2, that makes a pulse as wide as that; 0 for wider ones.
inline double least_pulse_blur(const ImpulseResponse& response, double bin_width) {
  const double least = kMinPulseBins * bin_width;
  return std::max(std::pow(least, 2) - std::pow(response.core_sigma(), 2), 0.0);
}

}  // namespace blindcorner
