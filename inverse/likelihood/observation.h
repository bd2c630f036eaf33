// SPDX-License-Identifier: Apache-2.0
/// Captures made ready for the likelihood: which bins of which zones count.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "inverse/likelihood/likelihood.h"

namespace blindcorner {

/// One zone of one capture. Bins in which neither the object nor the direct return can put light
/// hold only ambient light; where photons are counted, the sum of these bins says as much as the
/// single bins.
struct ObservedZone {
  int capture = 0;  ///< index among the captures of a joint fit
  int zone = 0;
  std::size_t noise_model = 0;  ///< index into Observation::likelihood
  int first = 0;                ///< first bin of the gate
  std::vector<double> counts;   ///< [gate]
  std::vector<double>
      saturated;  ///< [gate] negative saturated log likelihood: the best that any mean attains
  std::vector<int> censored;    ///< bins of the gate whose count stands for "zero or less"
  std::vector<double> counted;  ///< [gate] 0 in the censored bins, else 1
  std::vector<double> best;     ///< [gate] the mean that attains `saturated`
  /// [gate] factor on each bin's log likelihood: the photon variance over the sum of photon
  /// variance and the static background's own error variance. Empty: ones.
  std::vector<double> weight;
  double outside_bins = 0;   ///< valid bins outside the gate, where photons are counted
  double outside_count = 0;  ///< their total count
  double gain = 1;           ///< counts per W/m^2

  int bins() const { return static_cast<int>(counts.size()); }
  double weight_of(int bin) const {
    return weight.empty() ? 1.0 : weight[static_cast<std::size_t>(bin)];
  }
};

/// Time gate per zone: [first, end).
struct TimeGate {
  int first = 0, end = 0;
};

/// All zones of one or several captures, with the likelihood of each capture.
struct Observation {
  std::vector<ObservedZone> zones;
  /// One per capture, or one per observed zone where exposures or noise differ from zone to zone.
  std::vector<std::shared_ptr<const BinLikelihood>> likelihood;
  int captures = 0;
  /// Whether the static background has to be CompiledScene::fine_background().
  bool fine_background = false;

  double total_count() const;
  const BinLikelihood& noise_model(const ObservedZone& zone) const {
    return *likelihood[zone.noise_model];
  }
};

/// Takes saturated bins from the zones' valid bins: a bin that captures fill up to the sensor's
/// `saturation` tells no more than that there was much light. A bin is taken if more than one in
/// twenty of the captures fill it. Each zone keeps the longest run of the bins that are left, the
/// later one of two; without any it is dead. Captures of another shape are ignored. Returns one
/// line that says what was left out; empty: nothing.
std::string leave_out_saturated_bins(Sensor& sensor, std::span<const Capture* const> captures);

/// Whether a valid bin of the capture is full. The capture must suit the sensor.
bool saturates(const Sensor& sensor, const Capture& capture);

/// Throws Error when a capture does not suit the scene: zones, bins, NaN or infinite values,
/// negative counts of photons, valid bins that saturate.
void check_capture(const Scene& scene, const Capture& capture);

/// Cuts captures to their gates. `gates` is [captures][zones]; an empty gate drops the zone.
Observation observe(const Scene& scene, std::span<const Capture> captures,
                    const std::vector<std::vector<TimeGate>>& gates);

}  // namespace blindcorner
