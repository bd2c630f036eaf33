// SPDX-License-Identifier: Apache-2.0
/// Expected counts and their random realisations.
#pragma once

#include <cstdint>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

/// Values of the linear terms, for simulated captures.
struct LinearValues {
  double amplitude = 1.0;
  double ambient = 0.0;  ///< counts per bin
  double direct = 1.0;
  double background = 1.0;  ///< factor on the zones' measured background
};

/// Expected counts per zone and bin: gain * (amplitude * S + direct * static) + ambient +
/// background. The detector's pile-up follows, if the sensor has any. Dead zones stay zero.
HistogramCube expected_counts(const Scene& scene, const HistogramCube& three_bounce,
                              const HistogramCube& static_background, const LinearValues& linear);

/// Whether captures contain static light: a direct return or a measured background.
bool has_static_background(const Scene& scene);

/// The static background in counts, [zone][bin]: gain * direct return, times the direct return's
/// scale where that scale is fixed, plus the zone's measured background. A free scale multiplies
/// this whole sum.
HistogramCube static_background(const Scene& scene, const HistogramCube& static_background);

/// Applies Coates' model of a detector that reports only the first photon of each laser pulse. Let
/// a bin expect m counts without pile-up in N cycles, and let p = 1 - exp(-m / N) be the
/// probability of a photon in the bin. With pile-up the bin expects N p times the share of cycles
/// in which no earlier bin had a photon. Works in place, on one zone. (Coates, J. Phys. E 1, 878,
/// 1968.)
void pile_up(double cycles, double* counts, int bins);

/// Coates' correction, the inverse of pile_up() for one zone. It computes the counts without
/// pile-up from the mean counts of exposures of `cycles` each; both arrays are [bins]. `live`
/// [bins] receives counts over corrected counts: the share of the light that was recorded.
void undo_pile_up(double cycles, const double* counts, int bins, double* corrected, double* live);

/// Limits counts to what a bin can hold, if the sensor states such a limit.
void saturate(const Sensor& sensor, HistogramCube& counts);

/// Variance (counts^2) of one bin of one exposure whose expected count is `counts`, by the zone's
/// noise model.
double count_variance(const Sensor& sensor, int zone, double counts);

/// Draws random counts from expected counts by the scene's noise model. Counts are Poisson counts
/// scaled to the dispersion, or Gaussian counts with the stated variance law, censored at zero if
/// the sensor does that. Under pile-up each bin is binomial given the earlier bins, with the
/// probability that the expected counts give. The average over `exposures` saturates. The same seed
/// gives the same counts.
HistogramCube draw_counts(const Scene& scene, const HistogramCube& expected, double exposures,
                          std::uint64_t seed);

}  // namespace blindcorner
