// SPDX-License-Identifier: Apache-2.0
/// A noise model: photons and the noise of the electronics that read them out. docs/adding.md shows
/// it; adding_test.cpp draws from it.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>

#include "blindcorner/forward/sensor/noise_model.h"

namespace blindcorner {

// [noise]
/// Photon counts with Gaussian readout noise: variance = readout^2 + dispersion * mean. The readout
/// may make counts negative.
struct ReadoutNoise {
  static constexpr const char* kName = "readout";
  static constexpr bool kCountsPhotons = false;

  double readout = 1.0;  ///< counts, standard deviation of one exposure

  double variance(double mean, double dispersion) const {
    return readout * readout + dispersion * std::max(mean, 0.0);
  }
  std::optional<VarianceLine> stated_line() const { return VarianceLine{readout * readout, 1.0}; }
  void state_line(const VarianceLine& line) { readout = std::sqrt(line.floor); }

  template <class Random>
  void draw(double* counts, int bins, double exposures, double dispersion, Random& random) const {
    std::normal_distribution<double> normal(0, readout / std::sqrt(exposures));
    PoissonNoise{}.draw(counts, bins, exposures, dispersion, random);
    for (int k = 0; k < bins; ++k) counts[k] += normal(random);
  }
};
// [/noise]

}  // namespace blindcorner
