// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/detection.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "inverse/likelihood/background_error.h"

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

double EmptyScores::exceeded_by(double share) const {
  return location - scale * std::log(-std::log1p(-share));
}

namespace {

/// Levels of light and exposures are limited to this many octaves either way. By judgement:
/// captures differ by less than a factor of a million.
constexpr double kMaxOctaves = 20;
/// Octaves between levels. An octave moves the law's location and scale by at most 0.04
/// (DENALI-like and TMF8828 scenes, 2^-8 to 2^8 photons a bin), a third of the uncertainty that 128
/// captures leave. All levels are simulated with the same deviates, so that interpolation would
/// gain nothing.
constexpr int kStep = 2;
/// Least share of the most exposures that a zone is simulated with, in octaves. A zone with less
/// than a thousandth of them adds as little to what all zones say.
constexpr int kMinShare = -10;

int octaves(double ratio) {
  const double exact = std::clamp(std::log2(std::max(ratio, 1e-300)), -kMaxOctaves, kMaxOctaves);
  return kStep * static_cast<int>(std::lround(exact / kStep));
}

/// Expected counts that equal their own standard deviation.
double light_unit(const BinLikelihood& noise_model) {
  constexpr int kIterations = 60;  // each halves the logarithm's error, to rounding
  double counts = 1;
  for (int i = 0; i < kIterations; ++i) counts = std::sqrt(noise_model.variance(counts));
  return counts;
}

/// Standard normal deviates, the same with every standard library (Box and Muller).
class NormalDeviates {
 public:
  explicit NormalDeviates(std::uint64_t seed) : random_(seed) {}

  double next() {
    if (std::exchange(has_second_, !has_second_)) return second_;
    const double radius = std::sqrt(-2 * std::log(uniform()));
    const double angle = 2 * kPi * uniform();
    second_ = radius * std::sin(angle);
    return radius * std::cos(angle);
  }

 private:
  double uniform() { return (static_cast<double>(random_() >> 11) + 0.5) * 0x1p-53; }

  std::mt19937_64 random_;
  bool has_second_ = false;
  double second_ = 0;
};

/// Captures without a count, taken with the level's exposures.
std::vector<Capture> blank_captures(const CompiledScene& compiled, const EmptyLevel& level) {
  const Sensor& sensor = compiled.scene.sensor;
  const double most = std::exp2(level.exposures);
  std::vector<Capture> captures(compiled.gates.size());
  auto share = level.share.begin();
  for (Capture& capture : captures) {
    capture.counts = HistogramCube(sensor.rows, sensor.columns, sensor.bins);
    capture.exposures = most;
    capture.dispersion = 1;
    if (level.share.empty()) continue;
    capture.zone_exposures.emplace();
    for (int z = 0; z < sensor.zone_count(); ++z, ++share) {
      capture.zone_exposures->push_back(most * std::exp2(*share));
    }
  }
  return captures;
}

}  // namespace

EmptyLevel empty_level(const PoseObjective& objective, const LinearSolution& empty) {
  const Observation& observation = objective.solver().observation();
  const auto zones = static_cast<std::size_t>(objective.compiled().scene.sensor.zone_count());
  EmptyLevel level;
  double most = 0;
  double units = 0;
  for (std::size_t z = 0; z < observation.zones.size(); ++z) {
    const BinLikelihood& noise_model = observation.noise_model(observation.zones[z]);
    most = std::max(most, noise_model.scale());
    units += empty.ambient[z] / light_unit(noise_model);
  }
  level.ambient = octaves(units / static_cast<double>(observation.zones.size()));
  level.exposures = octaves(most);
  level.share.resize(static_cast<std::size_t>(observation.captures) * zones);
  for (const ObservedZone& zone : observation.zones) {
    const double share = std::log2(observation.noise_model(zone).scale() / most);
    level.share[static_cast<std::size_t>(zone.capture) * zones +
                static_cast<std::size_t>(zone.zone)] =
        std::max(static_cast<int>(std::lround(share)), kMinShare);
  }
  if (std::ranges::all_of(level.share, [](int share) { return share == 0; })) level.share.clear();
  return level;
}

EmptyScores simulate_empty(const CompiledScene& compiled, const EmptyLevel& level, int captures,
                           std::uint64_t seed) {
  const std::vector<Capture> blank = blank_captures(compiled, level);
  Observation observation = observe(compiled.scene, blank, compiled.gates);
  const LinearUnknowns& unknowns = compiled.scene.linear;
  LinearSolution typical;
  typical.amplitude.assign(observation.zones.size(), 0.0);
  typical.direct.assign(observation.zones.size(), 1.0);
  double units = 0;  // sum over zones of one count per bin, in units of light
  for (const ObservedZone& zone : observation.zones)
    units += 1 / light_unit(observation.noise_model(zone));
  const double ambient =
      std::exp2(level.ambient) * static_cast<double>(observation.zones.size()) / units;
  typical.ambient.assign(observation.zones.size(),
                         unknowns.ambient == LinearMode::fixed ? unknowns.fixed_ambient : ambient);
  weigh(compiled, typical, observation);
  const PoseObjective objective(compiled, observation);
  const MatchedFilter filter(objective, typical, MatchedFilter::Weights::expected,
                             MatchedFilter::Priors::ignored);

  NormalDeviates deviates(seed);
  Eigen::MatrixXf counts(objective.rows(), captures);
  int row = 0;
  for (const ObservedZone& zone : observation.zones) {
    const BinLikelihood& noise_model = observation.noise_model(zone);
    for (int k = 0; k < zone.bins(); ++k, ++row) {
      const auto mean = static_cast<double>(filter.mean()[row]);
      // The static background's own error adds to the photon noise.
      const double wider = 1 / std::sqrt(zone.weight_of(k));
      for (int i = 0; i < captures; ++i) {
        const double drawn = noise_model.quantile(mean, deviates.next());
        counts(row, i) = static_cast<float>(wider > 1 ? mean + wider * (drawn - mean) : drawn);
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

double FalseAlarmCalibration::probability(const PoseObjective& objective,
                                          const LinearSolution& empty, int captures,
                                          std::uint64_t seed) {
  const MatchedFilter filter(objective, empty, MatchedFilter::Weights::expected,
                             MatchedFilter::Priors::ignored);
  const double score = static_cast<double>(filter.scores().maxCoeff());
  const EmptyLevel level = empty_level(objective, empty);
  const CompiledScene& compiled = home_ != nullptr ? *home_ : objective.compiled();
  const std::scoped_lock lock(mutex_);
  const auto [entry, is_new] = known_.try_emplace(level);
  if (is_new) entry->second = simulate_empty(compiled, level, captures, seed);
  return entry->second.exceedance(score);
}

}  // namespace blindcorner
