// SPDX-License-Identifier: Apache-2.0
#include "inverse/likelihood/observation.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/sensor/photon_noise.h"

namespace blindcorner {

namespace {

/// Number of exposures that stands for none. Noise a thousand times that of one exposure tells
/// nothing.
constexpr double kNoExposure = 1e-6;

/// Pile-up that hides less than this share of the light is not corrected. By judgement: the scale
/// of the light is fitted anyway, and its shape changes by less.
constexpr double kPileUpMatters = 0.01;

/// Counts as they would be without pile-up, and the share of the light that was recorded.
struct Unpiled {
  HistogramCube counts;
  double live = 1;
};

/// Coates' correction. Let e be the share of the light that was recorded. Given the earlier bins, a
/// bin's count is binomial. Its likelihood in the expected light m has its maximum at the corrected
/// count n / e. For a light of l photons per cycle and bin, the likelihood's curvature is within
/// l^2 / 12 of e times that of a Poisson law. So the corrected counts follow a Poisson law with e
/// as exposure, which is convex in the linear unknowns. Behind the first bounce, where the object's
/// light is, e hardly changes: its mean over bins and zones stands for all of them.
Unpiled without_pile_up(const Sensor& sensor, const Capture& capture) {
  Unpiled result{capture.counts, 1.0};
  if (sensor.pile_up_cycles <= 0 || !sensor.noise.counts_photons()) {
    return result;
  }
  const int bins = capture.counts.bins;
  HistogramCube corrected = capture.counts;
  std::vector<double> live(static_cast<std::size_t>(bins));
  double sum = 0;
  double least = 1;
  int count = 0;
  for (int z = 0; z < corrected.zones(); ++z) {
    if (sensor.zones[static_cast<std::size_t>(z)].dead) continue;
    undo_pile_up(sensor.pile_up_cycles, capture.counts.zone(z), bins, corrected.zone(z),
                 live.data());
    sum += std::accumulate(live.begin(), live.end(), 0.0);
    least = std::min(least, *std::min_element(live.begin(), live.end()));
    count += bins;
  }
  if (count == 0 || least > 1 - kPileUpMatters) return result;
  return {std::move(corrected), sum / count};
}

/// Share of captures that may saturate a bin before the bin is left out of all. By judgement:
/// between leaving out those captures and losing the bin in the others.
constexpr double kRarelySaturated = 0.05;

/// Longest run in [first, end) of bins that are not `full`; the later one of two equal runs.
TimeGate longest_run(const std::vector<bool>& full, int first, int end) {
  TimeGate longest, run{first, first};
  for (int k = first; k < end; ++k) {
    if (full[static_cast<std::size_t>(k)]) {
      run = {k + 1, k + 1};
    } else {
      run.end = k + 1;
      if (run.end - run.first >= longest.end - longest.first) longest = run;
    }
  }
  return longest;
}

}  // namespace

std::string leave_out_saturated_bins(Sensor& sensor, std::span<const Capture* const> captures) {
  if (sensor.saturation <= 0) return {};
  std::vector<const HistogramCube*> cubes;
  for (const Capture* capture : captures) {
    const HistogramCube& counts = capture->counts;
    const bool suits = counts.rows == sensor.rows && counts.columns == sensor.columns &&
                       counts.bins == sensor.bins;
    if (suits) cubes.push_back(&counts);
  }
  int zones = 0, dead = 0, bins = 0;
  for (int z = 0; z < sensor.zone_count(); ++z) {
    Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
    if (zone.dead) continue;
    const int first = zone.first_valid_bin;
    const int end = sensor.valid_end(z);
    std::vector<bool> full(static_cast<std::size_t>(sensor.bins));
    for (int k = first; k < end; ++k) {
      const auto count = std::ranges::count_if(
          cubes, [&](const HistogramCube* counts) { return sensor.saturates(counts->zone(z)[k]); });
      full[static_cast<std::size_t>(k)] =
          static_cast<double>(count) > kRarelySaturated * static_cast<double>(cubes.size());
    }
    const TimeGate kept = longest_run(full, first, end);
    const int lost = end - first - (kept.end - kept.first);
    if (lost == 0) continue;
    ++zones;
    bins += lost;
    zone.dead = kept.first == kept.end;
    dead += zone.dead ? 1 : 0;
    if (zone.dead) continue;
    zone.first_valid_bin = kept.first;
    zone.last_valid_bin = kept.end - 1;
  }
  if (zones == 0) return {};
  std::string line = "saturation: left out " + std::to_string(bins) + " bins of " +
                     std::to_string(zones) + " zones, at and beside those that captures fill up";
  if (dead > 0) line += "; nothing is left of " + std::to_string(dead) + " zones";
  return line;
}

bool saturates(const Sensor& sensor, const Capture& capture) {
  for (int z = 0; z < sensor.zone_count(); ++z) {
    const Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
    if (zone.dead) continue;
    const double* counts = capture.counts.zone(z);
    if (std::any_of(counts + zone.first_valid_bin, counts + sensor.valid_end(z),
                    [&](double value) { return sensor.saturates(value); })) {
      return true;
    }
  }
  return false;
}

double Observation::total_count() const {
  double total = 0;
  for (const ObservedZone& zone : zones) {
    total += zone.outside_count + std::accumulate(zone.counts.begin(), zone.counts.end(), 0.0);
  }
  return total;
}

void check_capture(const Scene& scene, const Capture& capture) {
  const Sensor& sensor = scene.sensor;
  const HistogramCube& counts = capture.counts;
  const std::string where = capture.source + " capture " + std::to_string(capture.index);
  const auto shape = [](int rows, int columns, int bins) {
    return std::to_string(rows) + " x " + std::to_string(columns) + " zones of " +
           std::to_string(bins) + " bins";
  };
  if (counts.rows != sensor.rows || counts.columns != sensor.columns ||
      counts.bins != sensor.bins) {
    throw Error(where, "counts: found " + shape(counts.rows, counts.columns, counts.bins) +
                           ", accepted: the scene's " +
                           shape(sensor.rows, sensor.columns, sensor.bins));
  }
  if (!(capture.exposures > 0) || !std::isfinite(capture.exposures)) {
    throw Error(where, "exposures: found " + std::to_string(capture.exposures) + ", accepted: > 0");
  }
  if (capture.zone_exposures &&
      capture.zone_exposures->size() != static_cast<std::size_t>(counts.zones())) {
    throw Error(where, "zone_exposures: found " + std::to_string(capture.zone_exposures->size()) +
                           " numbers, accepted: one per zone");
  }
  if (capture.dispersion && !(*capture.dispersion > 0 && std::isfinite(*capture.dispersion))) {
    throw Error(where,
                "dispersion: found " + std::to_string(*capture.dispersion) + ", accepted: > 0");
  }
  const bool photons = sensor.noise.counts_photons();
  for (int z = 0; z < counts.zones(); ++z) {
    const Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
    if (zone.dead) continue;
    for (int k = zone.first_valid_bin; k < sensor.valid_end(z); ++k) {
      const double value = counts.zone(z)[k];
      if (std::isfinite(value) && (value >= 0 || !photons) && !sensor.saturates(value)) continue;
      std::string accepted = "finite values";
      if (photons) accepted = std::string("finite counts >= 0 (") + sensor.noise.name() + " noise)";
      if (sensor.saturation > 0) {
        accepted += " below the saturation of " + std::to_string(sensor.saturation);
      }
      throw Error(where, "counts[zone " + std::to_string(z) + "][bin " + std::to_string(k) +
                             "]: found " + std::to_string(value) + ", accepted: " + accepted);
    }
  }
}

Observation observe(const Scene& scene, std::span<const Capture> captures,
                    const std::vector<std::vector<TimeGate>>& gates) {
  const Sensor& sensor = scene.sensor;
  Observation observation;
  observation.captures = static_cast<int>(captures.size());
  for (std::size_t c = 0; c < captures.size(); ++c) {
    const Capture& capture = captures[c];
    const double dispersion = capture.dispersion.value_or(sensor.dispersion);
    const Unpiled unpiled = without_pile_up(sensor, capture);
    const bool own_laws = capture.zone_exposures || sensor.zones_have_noise_floors();
    if (!own_laws) {
      observation.likelihood.push_back(
          make_likelihood(sensor.noise, dispersion, capture.exposures * unpiled.live));
    }
    for (int z = 0; z < sensor.zone_count(); ++z) {
      const Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
      const int valid_first = zone.first_valid_bin;
      const int valid_end = sensor.valid_end(z);
      TimeGate gate = gates[c][static_cast<std::size_t>(z)];
      gate.first = std::max(gate.first, valid_first);
      gate.end = std::min(gate.end, valid_end);
      if (zone.dead || gate.first >= gate.end) continue;
      if (own_laws) {
        // A zone without data keeps its place among the rows of the compiled scene.
        observation.likelihood.push_back(
            make_likelihood(sensor.noise_of(z), dispersion,
                            std::max(capture.exposures_of(z) * unpiled.live, kNoExposure)));
      }
      const BinLikelihood& noise_model = *observation.likelihood.back();
      ObservedZone observed;
      observed.capture = static_cast<int>(c);
      observed.zone = z;
      observed.noise_model = observation.likelihood.size() - 1;
      observed.first = gate.first;
      observed.gain = zone.gain;
      const double* counts = unpiled.counts.zone(z);
      observed.counts.assign(counts + gate.first, counts + gate.end);
      for (int k = 0; k < observed.bins(); ++k) {
        const bool censored =
            noise_model.censored() && observed.counts[static_cast<std::size_t>(k)] <= 0;
        if (censored) observed.censored.push_back(k);
        observed.counted.push_back(censored ? 0.0 : 1.0);
      }
      for (const double n : observed.counts) {
        observed.best.push_back(noise_model.best(n));
        observed.saturated.push_back(noise_model.saturated(n));
      }
      if (noise_model.counts_photons()) {
        observed.outside_bins = valid_end - valid_first - (gate.end - gate.first);
        observed.outside_count = std::accumulate(counts + valid_first, counts + gate.first, 0.0) +
                                 std::accumulate(counts + gate.end, counts + valid_end, 0.0);
      }
      observation.zones.push_back(std::move(observed));
    }
  }
  return observation;
}

}  // namespace blindcorner
