// SPDX-License-Identifier: Apache-2.0
/// Expected counts and their random realisations.
#pragma once

#include <cstdint>

#include "blindcorner/forward/capture.h"
#include "blindcorner/forward/scene.h"

namespace blindcorner {

/// Values of the linear terms for making captures.
struct LinearValues {
  double amplitude = 1.0;
  double ambient = 0.0;  ///< counts per bin
  double direct = 1.0;
};

/// gain * (amplitude * S + direct * static) + ambient, per zone and bin. Dead zones stay zero.
HistogramCube expected_counts(const Scene& scene, const HistogramCube& three_bounce,
                              const HistogramCube& direct_return, const LinearValues& linear);

/// Draws counts from expected ones by the scene's noise law: Poisson scaled to the dispersion, or
/// Gaussian with the stated variance law, censored at zero if the sensor does that. `exposures` are
/// averaged. The same seed gives the same counts.
HistogramCube draw_counts(const Scene& scene, const HistogramCube& expected, double exposures,
                          std::uint64_t seed);

}  // namespace blindcorner
