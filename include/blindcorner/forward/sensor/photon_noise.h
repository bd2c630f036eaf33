// SPDX-License-Identifier: Apache-2.0
/// Expected counts and their random realisations.
#pragma once

#include <cstdint>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

/// Values of the linear terms for making captures.
struct LinearValues {
  double amplitude = 1.0;
  double ambient = 0.0;  ///< counts per bin
  double direct = 1.0;
  double background = 1.0;  ///< factor on the zones' measured background
};

/// gain * (amplitude * S + direct * static) + ambient + background, per zone and bin, then the
/// detector's pile-up if the sensor has any. Dead zones stay zero.
HistogramCube expected_counts(const Scene& scene, const HistogramCube& three_bounce,
                              const HistogramCube& static_background, const LinearValues& linear);

/// Whether captures hold static light: a direct return or a measured background.
bool has_static_background(const Scene& scene);

/// The static light, counts of [zone][bin]: gain * direct return, times its scale where that is
/// fixed, plus the zone's background. Where the scale is free, it is this that is scaled.
HistogramCube static_background(const Scene& scene, const HistogramCube& static_background);

/// Coates' model of a detector that reports the first photon of each laser pulse: with p = 1 -
/// exp(-m / N) the probability of a photon in a bin, m counts expected without pile-up in N cycles,
/// a bin expects N p times the share of cycles in which no earlier bin had one. In place, one zone.
/// (Coates, J. Phys. E 1, 878, 1968.)
void pile_up(double cycles, double* counts, int bins);

/// Coates' correction, the inverse, of one zone: the counts without pile-up from the mean counts of
/// exposures of `cycles` each, both [bins]. `live` gets, per bin, counts over corrected counts: how
/// much of the light was recorded.
void undo_pile_up(double cycles, const double* counts, int bins, double* corrected, double* live);

/// Cuts counts at what a bin can hold, if the sensor has such a limit.
void saturate(const Sensor& sensor, HistogramCube& counts);

/// Variance of one bin of one exposure that expects `counts`, by the zone's noise model, counts^2.
double count_variance(const Sensor& sensor, int zone, double counts);

/// Draws counts from expected ones by the scene's noise model: Poisson scaled to the dispersion, or
/// Gaussian with the stated variance law, censored at zero if the sensor does that. Under pile-up
/// each bin is binomial given the earlier ones, its probability that of the expected counts. The
/// average of the `exposures` saturates. The same seed gives the same counts.
HistogramCube draw_counts(const Scene& scene, const HistogramCube& expected, double exposures,
                          std::uint64_t seed);

}  // namespace blindcorner
