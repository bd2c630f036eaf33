// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/sensor/photon_noise.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace blindcorner {

void pile_up(double cycles, double* counts, int bins) {
  double free = 1;  // share of cycles without a photon so far
  for (int k = 0; k < bins; ++k) {
    const double passed = std::exp(-std::max(counts[k], 0.0) / cycles);
    counts[k] = cycles * free * (1 - passed);
    free *= passed;
  }
}

void undo_pile_up(double cycles, const double* counts, int bins, double* corrected, double* live) {
  double free = cycles;
  for (int k = 0; k < bins; ++k) {
    // At least half a cycle stays free: the last photon of a full detector says no more than that.
    const double hit = std::min(counts[k], std::max(free - 0.5, 0.0));
    const double share = free > 0 ? hit / free : 0.0;
    corrected[k] = -cycles * std::log1p(-share);
    // A bin without counts was live for the share of cycles that were free.
    live[k] = corrected[k] > 0 ? hit / corrected[k] : std::max(free, 0.5) / cycles;
    free -= hit;
  }
}

void saturate(const Sensor& sensor, HistogramCube& counts) {
  if (sensor.saturation <= 0) return;
  for (double& value : counts.values) value = std::min(value, sensor.saturation);
}

namespace {

/// Above this variance, a Poisson or binomial number is drawn from the normal distribution with its
/// mean and variance. The two distribution functions differ by at most 0.07 / sqrt(variance) (the
/// first term of Edgeworth's series), which is 2e-6 here. The exact methods fail beyond a 64-bit
/// integer, and long before that their logarithms lack precision.
constexpr double kNormalVariance = 1e9;
/// With more tries than this, the binomial method's logarithms lack precision: they round ln n! =
/// 2e11 by 1e-16 of it. A number with a variance above kManyTriesVariance is then drawn as normal,
/// which is right to 7e-5. Below it, the rarer outcome is drawn as a Poisson number. The error is
/// that outcome's share of the tries, at most 1e-4.
constexpr double kMaxTries = 1e10;
constexpr double kManyTriesVariance = 1e6;

double draw_normal_counts(double mean, double variance, std::mt19937_64& random) {
  std::normal_distribution<double> normal(mean, std::sqrt(variance));
  return std::max(std::round(normal(random)), 0.0);
}

double draw_photons(double mean, std::mt19937_64& random) {
  if (mean > kNormalVariance) return draw_normal_counts(mean, mean, random);
  std::poisson_distribution<long long> poisson(mean);
  return static_cast<double>(poisson(random));
}

/// Draws how many of `tries`, a whole number, hit.
double draw_hits(double tries, double hit, std::mt19937_64& random) {
  const double variance = tries * hit * (1 - hit);
  if (variance > kNormalVariance || (tries > kMaxTries && variance > kManyTriesVariance)) {
    return std::min(draw_normal_counts(tries * hit, variance, random), tries);
  }
  if (tries > kMaxTries) {
    const bool rare = hit < 0.5;
    const double rarer = std::min(draw_photons(tries * (rare ? hit : 1 - hit), random), tries);
    return rare ? rarer : tries - rarer;
  }
  std::binomial_distribution<long long> binomial(static_cast<long long>(tries), hit);
  return static_cast<double>(binomial(random));
}

/// Replaces a zone's expected counts by drawn ones: the average over `exposures` under the zone's
/// noise model.
void draw_zone(const NoiseModel& noise, double exposures, double dispersion, double* counts,
               int bins, std::mt19937_64& random) {
  const double scale = exposures / dispersion;
  const bool bright =
      noise.counts_photons() && *std::max_element(counts, counts + bins) * scale > kNormalVariance;
  if (!bright) return noise.draw(counts, bins, exposures, dispersion, random);
  for (int k = 0; k < bins; ++k) {
    if (counts[k] > 0) counts[k] = draw_photons(counts[k] * scale, random) / scale;
  }
}

/// Draws counts by Coates' model of pile-up. In each bin, each cycle that is still free gives a
/// photon with the probability of the bin's expected counts over the expected number of free
/// cycles.
void draw_piled_up(double cycles, double exposures, double* counts, int bins,
                   std::mt19937_64& random) {
  double expected_free = cycles;
  double free = std::round(cycles * exposures);
  for (int k = 0; k < bins; ++k) {
    const double hit = expected_free > 0 ? std::min(counts[k] / expected_free, 1.0) : 0.0;
    expected_free -= counts[k];
    const double drawn = hit > 0 && free > 0 ? draw_hits(free, hit, random) : 0;
    free -= drawn;
    counts[k] = drawn / exposures;
  }
}

}  // namespace

HistogramCube expected_counts(const Scene& scene, const HistogramCube& three_bounce,
                              const HistogramCube& static_background, const LinearValues& linear) {
  HistogramCube counts(three_bounce.rows, three_bounce.columns, three_bounce.bins);
  for (int z = 0; z < counts.zones(); ++z) {
    const Zone& zone = scene.sensor.zones[static_cast<std::size_t>(z)];
    if (zone.dead) continue;
    for (int k = 0; k < counts.bins; ++k) {
      counts.zone(z)[k] = zone.gain * (linear.amplitude * three_bounce.zone(z)[k] +
                                       linear.direct * static_background.zone(z)[k]) +
                          linear.ambient + linear.background * zone.background_at(k);
    }
    if (scene.sensor.pile_up_cycles > 0) {
      pile_up(scene.sensor.pile_up_cycles, counts.zone(z), counts.bins);
    }
  }
  return counts;
}

bool has_static_background(const Scene& scene) {
  return scene.linear.direct == LinearMode::per_zone || scene.linear.fixed_direct > 0 ||
         scene.sensor.has_background();
}

HistogramCube static_background(const Scene& scene, const HistogramCube& static_background) {
  HistogramCube counts = static_background;
  const LinearUnknowns& linear = scene.linear;
  const double scale = linear.direct == LinearMode::fixed ? linear.fixed_direct : 1.0;
  for (int z = 0; z < counts.zones(); ++z) {
    const Zone& zone = scene.sensor.zones[static_cast<std::size_t>(z)];
    for (int k = 0; k < counts.bins; ++k) {
      counts.zone(z)[k] = zone.gain * scale * counts.zone(z)[k] + zone.background_at(k);
    }
  }
  return counts;
}

double count_variance(const Sensor& sensor, int zone, double counts) {
  return sensor.noise_of(zone).variance(counts, sensor.dispersion);
}

HistogramCube draw_counts(const Scene& scene, const HistogramCube& expected, double exposures,
                          std::uint64_t seed) {
  const Sensor& sensor = scene.sensor;
  std::mt19937_64 random(seed);
  HistogramCube counts = expected;
  for (int z = 0; z < counts.zones(); ++z) {
    if (sensor.zones[static_cast<std::size_t>(z)].dead) continue;
    if (sensor.pile_up_cycles > 0) {
      draw_piled_up(sensor.pile_up_cycles, exposures, counts.zone(z), counts.bins, random);
    } else {
      double* const bins = counts.zone(z);
      const NoiseModel& noise = sensor.noise_of(z);
      if (noise.counts_photons()) {  // rounding leaves some slightly below zero
        std::transform(bins, bins + counts.bins, bins, [](double c) { return std::max(c, 0.0); });
      }
      draw_zone(noise, exposures, sensor.dispersion, bins, counts.bins, random);
    }
  }
  saturate(sensor, counts);
  return counts;
}

}  // namespace blindcorner
