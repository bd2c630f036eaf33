// SPDX-License-Identifier: Apache-2.0
#include "inverse/likelihood/background_error.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace blindcorner {
namespace {

/// Share of the photon variance below which the error is left out: it would widen a standard
/// deviation by half as much.
constexpr double kMinShare = 0.01;
/// Bins to either side that tell how bright a bin is: its own count alone would weigh itself, and
/// has a fifth of the say. By judgement; light changes over a pulse, which is a bin wide or wider.
constexpr int kReach = 2;

}  // namespace

void weigh(const CompiledScene& compiled, const LinearSolution& empty, Observation& observation) {
  if (compiled.background_error.empty()) return;
  double largest = 0;
  std::size_t row = 0;
  for (std::size_t z = 0; z < observation.zones.size(); ++z) {
    ObservedZone& zone = observation.zones[z];
    const BinLikelihood& noise_model = observation.noise_model(zone);
    zone.weight.resize(zone.counts.size());
    for (int k = 0; k < zone.bins(); ++k, ++row) {
      const int first = std::max(k - kReach, 0), end = std::min(k + kReach + 1, zone.bins());
      const double around =
          std::accumulate(zone.counts.begin() + first, zone.counts.begin() + end, 0.0) /
          (end - first);
      const double known = empty.direct[z] * compiled.direct[row] + empty.ambient[z];
      const double photons = std::max(noise_model.variance(std::max(known, around)), 1e-300);
      const double share = std::pow(empty.direct[z] * compiled.background_error[row], 2) / photons;
      largest = std::max(largest, share);
      zone.weight[static_cast<std::size_t>(k)] = 1 / (1 + share);
    }
  }
  if (largest >= kMinShare) return;
  for (ObservedZone& zone : observation.zones) zone.weight.clear();
}

Observation observe(const CompiledScene& compiled, std::span<const Capture> captures) {
  Observation observation = observe(compiled.scene, captures, compiled.gates);
  if (compiled.background_error.empty() || observation.zones.empty()) return observation;
  LinearSolution empty;
  PoseObjective(compiled, observation).evaluate_empty(empty);
  weigh(compiled, empty, observation);
  return observation;
}

}  // namespace blindcorner
