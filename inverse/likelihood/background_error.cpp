// SPDX-License-Identifier: Apache-2.0
#include "inverse/likelihood/background_error.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace blindcorner {
namespace {

/// The error is left out if its variance is below this share of the photon variance. It would widen
/// a standard deviation by half that share.
constexpr double kMinShare = 0.01;
/// Number of bins on either side that, with the bin itself, tell how bright a bin is. A bin's own
/// count alone would decide its own weight; this way it has a fifth of the say. By judgement: light
/// changes over a pulse, which is a bin wide or wider.
constexpr int kReach = 2;
/// Share above which a finer background is used, which costs as much as some renders. The error
/// would widen a standard deviation by 40 %.
constexpr double kWorthFiner = 1;

/// Photon variance of each bin, from its known or its counted light, whichever is brighter.
std::vector<double> photon_variances(const GatedBackground& background, const LinearSolution& empty,
                                     const Observation& observation) {
  std::vector<double> variances;
  for (std::size_t z = 0; z < observation.zones.size(); ++z) {
    const ObservedZone& zone = observation.zones[z];
    const BinLikelihood& noise_model = observation.noise_model(zone);
    for (int k = 0; k < zone.bins(); ++k) {
      const int first = std::max(k - kReach, 0), end = std::min(k + kReach + 1, zone.bins());
      const double around =
          std::accumulate(zone.counts.begin() + first, zone.counts.begin() + end, 0.0) /
          (end - first);
      const double known = empty.direct[z] * background.light[variances.size()] + empty.ambient[z];
      variances.push_back(std::max(noise_model.variance(std::max(known, around)), 1e-300));
    }
  }
  return variances;
}

/// The error's variance over the photon variance, for each bin.
std::vector<double> error_shares(const GatedBackground& background, const LinearSolution& empty,
                                 const Observation& observation,
                                 const std::vector<double>& photons) {
  std::vector<double> shares;
  for (std::size_t z = 0; z < observation.zones.size(); ++z) {
    for (int k = 0; k < observation.zones[z].bins(); ++k) {
      const std::size_t row = shares.size();
      shares.push_back(std::pow(empty.direct[z] * background.error[row], 2) / photons[row]);
    }
  }
  return shares;
}

}  // namespace

void weigh(const CompiledScene& compiled, const LinearSolution& empty, Observation& observation) {
  if (compiled.background.error.empty()) return;
  const std::vector<double> photons = photon_variances(compiled.background, empty, observation);
  std::vector<double> shares = error_shares(compiled.background, empty, observation, photons);
  const double largest = shares.empty() ? 0 : *std::ranges::max_element(shares);
  observation.fine_background = largest > kWorthFiner;
  if (largest < kMinShare) return;
  if (observation.fine_background) {
    const GatedBackground& fine = compiled.fine_background();
    if (fine.error.empty()) return;
    shares = error_shares(fine, empty, observation, photons);
  }
  auto share = shares.begin();
  for (ObservedZone& zone : observation.zones) {
    zone.weight.clear();
    for (int k = 0; k < zone.bins(); ++k) zone.weight.push_back(1 / (1 + *share++));
  }
}

Observation observe(const CompiledScene& compiled, std::span<const Capture> captures) {
  Observation observation = observe(compiled.scene, captures, compiled.gates);
  if (compiled.background.error.empty() || observation.zones.empty()) return observation;
  LinearSolution empty;
  PoseObjective(compiled, observation).evaluate_empty(empty);
  weigh(compiled, empty, observation);
  return observation;
}

}  // namespace blindcorner
