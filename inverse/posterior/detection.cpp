// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/detection.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace blindcorner {

double presence_probability(double log_evidence_present, double log_evidence_empty, double prior) {
  if (prior <= 0) return 0;
  if (prior >= 1) return 1;
  const double log_odds =
      log_evidence_present - log_evidence_empty + std::log(prior) - std::log1p(-prior);
  return 1 / (1 + std::exp(-log_odds));
}

double EmptyScores::exceedance(double score) const {
  const double z = (score - location) / scale;
  return -std::expm1(-std::exp(-z));
}

double FalseAlarmCalibration::probability(const PoseObjective& objective,
                                          const LinearSolution& empty, int captures,
                                          std::uint64_t seed) {
  const MatchedFilter filter(objective, empty, MatchedFilter::Weights::expected,
                             MatchedFilter::Priors::ignored);
  const double score = static_cast<double>(filter.scores().maxCoeff());
  const Observation& observation = objective.solver().observation();

  // The law depends on the light level while counts are few, so there is one per octave of the mean
  // photons per bin. It is made from that level alone, never from the capture that asked first.
  double scale = 0;
  for (const BinLikelihood& law : observation.likelihood)
    scale += law.scale() / static_cast<double>(observation.likelihood.size());
  double level = 0;
  for (const double ambient : empty.ambient)
    level += ambient / static_cast<double>(empty.ambient.size());
  const int octave = static_cast<int>(std::lround(std::log2(std::clamp(level * scale, 1e-6, 1e6))));
  const int scale_octave = static_cast<int>(std::lround(4 * std::log2(scale)));
  const std::scoped_lock lock(mutex_);
  const auto [entry, is_new] = known_.try_emplace({octave, scale_octave});
  if (is_new) entry->second = simulate(objective, empty, std::exp2(octave) / scale, captures, seed);
  return entry->second.exceedance(score);
}

EmptyScores FalseAlarmCalibration::simulate(const PoseObjective& objective, LinearSolution typical,
                                            double level, int captures, std::uint64_t seed) {
  const Observation& observation = objective.solver().observation();
  const LinearUnknowns& unknowns = objective.solver().unknowns();
  const bool fixed = unknowns.ambient == LinearMode::fixed;
  std::fill(typical.ambient.begin(), typical.ambient.end(), fixed ? unknowns.fixed_ambient : level);
  std::fill(typical.direct.begin(), typical.direct.end(),
            unknowns.direct == LinearMode::fixed ? unknowns.fixed_direct : 1.0);
  const MatchedFilter filter(objective, typical, MatchedFilter::Weights::expected,
                             MatchedFilter::Priors::ignored);

  std::mt19937_64 random(seed);
  Eigen::MatrixXf counts(objective.rows(), captures);
  int row = 0;
  for (const ObservedZone& zone : observation.zones) {
    const BinLikelihood& law = observation.law(zone);
    for (int k = 0; k < zone.bins(); ++k, ++row) {
      const auto mean = static_cast<double>(filter.mean()[row]);
      for (int i = 0; i < captures; ++i) {
        double value = 0;
        if (law.poisson()) {
          std::poisson_distribution<long long> poisson(std::max(mean, 1e-12) * law.scale());
          value = static_cast<double>(poisson(random)) / law.scale();
        } else {
          std::normal_distribution<double> normal(mean, std::sqrt(law.variance(mean)));
          value = normal(random);
          if (law.censored()) value = std::max(value, 0.0);
        }
        counts(row, i) = static_cast<float>(value);
      }
    }
  }
  const Eigen::VectorXf scores = filter.largest_scores(counts);
  const double mean = static_cast<double>(scores.mean());
  double variance = 0;
  for (const float s : scores) variance += std::pow(static_cast<double>(s) - mean, 2);
  variance /= std::max(captures - 1, 1);
  EmptyScores law;
  law.scale = std::max(std::sqrt(6 * variance) / std::numbers::pi, 1e-6);
  law.location = mean - std::numbers::egamma * law.scale;
  return law;
}

}  // namespace blindcorner
