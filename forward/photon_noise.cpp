// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/photon_noise.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace blindcorner {

HistogramCube expected_counts(const Scene& scene, const HistogramCube& three_bounce,
                              const HistogramCube& direct_return, const LinearValues& linear) {
  HistogramCube counts(three_bounce.rows, three_bounce.columns, three_bounce.bins);
  for (int z = 0; z < counts.zones(); ++z) {
    const Zone& zone = scene.sensor.zones[static_cast<std::size_t>(z)];
    if (zone.dead) continue;
    for (int k = 0; k < counts.bins; ++k) {
      counts.zone(z)[k] = zone.gain * (linear.amplitude * three_bounce.zone(z)[k] +
                                       linear.direct * direct_return.zone(z)[k]) +
                          linear.ambient;
    }
  }
  return counts;
}

HistogramCube draw_counts(const Scene& scene, const HistogramCube& expected, double exposures,
                          std::uint64_t seed) {
  std::mt19937_64 random(seed);
  HistogramCube counts = expected;
  if (const auto* gaussian = std::get_if<GaussianNoise>(&scene.sensor.noise)) {
    std::normal_distribution<double> normal;
    for (std::size_t i = 0; i < counts.values.size(); ++i) {
      const auto zone = i / static_cast<std::size_t>(counts.bins);
      if (scene.sensor.zones[zone].dead) continue;
      double& value = counts.values[i];
      const double variance =
          gaussian->variance_floor + gaussian->variance_per_count * std::max(value, 0.0);
      value += std::sqrt(variance / exposures) * normal(random);
      if (gaussian->censored_at_zero) value = std::max(value, 0.0);
    }
    return counts;
  }
  const double scale = exposures / scene.sensor.dispersion;
  for (double& value : counts.values) {
    if (value <= 0) continue;
    std::poisson_distribution<long long> poisson(value * scale);
    value = static_cast<double>(poisson(random)) / scale;
  }
  return counts;
}

}  // namespace blindcorner
