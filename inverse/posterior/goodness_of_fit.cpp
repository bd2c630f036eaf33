// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/goodness_of_fit.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace blindcorner {
namespace {

/// Weights carry a variance for the static background's errors, which go together over bins. It is
/// at least this many times the variance of a single bin's own error: 3.4 (reference floor), 4.3
/// (robot_corridor), 9 (street_corner), 16 (tmf8828_wall), measured against light that is sampled
/// four times as densely.
constexpr double kTogether = 3.4;

}  // namespace

GoodnessOfFit goodness_of_fit(const PoseObjective& objective, const Refined& optimum) {
  const Observation& observation = objective.solver().observation();
  GoodnessOfFit fit;
  ShapeBuffer at;
  objective.shapes(light_near(objective, optimum), optimum.pose, at);
  std::vector<double> mean;
  double variance = 0;
  for (std::size_t z = 0; z < observation.zones.size(); ++z) {
    const ObservedZone& zone = observation.zones[z];
    const BinLikelihood& noise_model = observation.noise_model(zone);
    mean.resize(zone.counts.size());
    objective.solver().expected(zone, at.shapes[z], optimum.linear.amplitude[z],
                                optimum.linear.ambient[z], optimum.linear.direct[z], mean.data());
    if (zone.outside_bins > 0) {
      mean.push_back(zone.outside_bins * optimum.linear.ambient[z]);
    }
    if (zone.weight.empty()) {
      noise_model.add_deviance_moments(mean, fit.expected, variance);
      continue;
    }
    for (std::size_t k = 0; k < mean.size(); ++k) {
      double one = 0, spread = 0;
      noise_model.add_deviance_moments({&mean[k], 1}, one, spread);
      const double photons = k < zone.weight.size() ? zone.weight[k] : 1.0;
      // The carried variance stands for errors that go together: a bin's own is this part of it.
      const double weight = photons + (1 - photons) / kTogether;
      fit.expected += weight * one;
      variance += weight * weight * spread;
    }
  }
  fit.deviance = -2 * optimum.value.log_likelihood;
  // Fitted unknowns take up about one unit of deviance each, where the data carries that much.
  const LinearUnknowns& unknowns = objective.solver().unknowns();
  double fitted = objective.compiled().unknown_count() + 1.0;
  const auto zones = static_cast<double>(observation.zones.size());
  if (unknowns.ambient == LinearMode::per_zone) fitted += zones;
  if (unknowns.direct == LinearMode::per_zone) fitted += zones;
  if (unknowns.amplitude == LinearMode::per_zone) fitted += zones - 1;
  fit.expected = std::max(fit.expected - fitted, 0.5 * fit.expected);
  fit.standard_deviation = std::sqrt(variance);
  fit.inflation = inflation(fit, fit.deviance);
  return fit;
}

double missed_log_likelihood(const PoseObjective& objective, const Refined& optimum) {
  const GoodnessOfFit fit = goodness_of_fit(objective, optimum);
  return 0.5 * std::max(fit.deviance - fit.expected, 0.0);
}

double inflation(const GoodnessOfFit& fit, double deviance) {
  return deviance - fit.expected > 3 * fit.standard_deviation ? deviance / fit.expected : 1.0;
}

}  // namespace blindcorner
