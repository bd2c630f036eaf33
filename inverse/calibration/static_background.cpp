// SPDX-License-Identifier: Apache-2.0
#include "inverse/calibration/static_background.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "forward/support/quantile.h"

namespace blindcorner {
namespace {

/// Fewer captures say nothing about a bin's scatter: eight give it to a quarter (root of 1 / 14).
/// Photons have a law of their own.
constexpr std::size_t kMinCaptures = 8;
/// Fewer bins without static light say nothing about a capture's level: of three, one bad bin
/// cannot move the median far.
constexpr std::size_t kMinBins = 3;
/// Distance from zero, in standard errors, at which static light is found: among thousands of bins,
/// none is as far off by chance.
constexpr double kFound = 5.0;
/// Counts farther off than this many standard deviations are moved to this distance: one capture
/// with something in view must not make a background. By judgement: a normal variable is as far off
/// once in 5e8.
constexpr double kClip = 6.0;
/// Number of turns that tell lit bins and the level of the others apart, by judgement. Each turn
/// finds lit bins that the turn before had hidden.
constexpr int kTurns = 4;
/// A bin cannot be used if its variance exceeds that of the zone's other bins by this factor, by
/// judgement: claims that rest on it are off by a factor of root two ...
constexpr double kRestless = 2.0;
/// ... and if the factor is this many standard deviations of a chi-square variable above one, which
/// does not happen by chance among thousands of bins.
constexpr double kRestlessSigmas = 8.0;
/// A bin is not judged by fewer photons than this, expected over all captures: of 20, less than
/// half is 2.2 standard deviations too few.
constexpr double kMinPhotons = 20.0;

/// Counts of one bin in one capture that the object does not light.
struct DarkCount {
  std::size_t bin = 0;
  double count = 0;     ///< less modelled object and direct return
  double direct = 0;    ///< the modelled direct return
  double variance = 0;  ///< by the noise model, at the expected counts
  double photons = 0;   ///< expected, where photons are counted
  double clip = 0;      ///< distance from the other captures beyond which it is clipped
  double cautious = 0;  ///< variance at the count itself where it is above the expected one
};

/// The dark counts of a zone in one capture.
struct DarkBins {
  std::vector<DarkCount> bins;
  double scale = 1;             ///< of the static light
  std::optional<double> level;  ///< of the ambient light, if it is fixed
};

/// Bins that the object lights, and their neighbours, of one observed zone.
std::vector<bool> lit_by_object(const ObservedZone& zone, const std::vector<double>& light,
                                int bins) {
  const double limit = kDarkShare * *std::ranges::max_element(light);
  std::vector<bool> lit(static_cast<std::size_t>(bins), false);
  for (std::size_t k = 0; k < light.size(); ++k) {
    if (light[k] <= limit) continue;
    const auto bin = static_cast<std::size_t>(zone.first) + k;
    for (std::size_t n = bin > 0 ? bin - 1 : 0; n < std::min(bin + 2, lit.size()); ++n) {
      lit[n] = true;
    }
  }
  return lit;
}

/// The dark counts of zone `z` in all captures that are kept and have data there.
std::vector<DarkBins> dark_bins(const CalibrationProblem& problem, const Evaluations& evaluations,
                                const std::vector<double>& keep, int z, Knowledge knowledge) {
  const Scene& scene = problem.base();
  const Zone& zone = scene.sensor.zones[static_cast<std::size_t>(z)];
  std::vector<DarkBins> list;
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    if (keep[c] <= 0 || problem.capture(c).exposures_of(z) <= 0) continue;
    const Observation& observation = problem.observation(c);
    const CalibrationProblem::Evaluation& evaluation = evaluations[c];
    std::vector<bool> lit(static_cast<std::size_t>(scene.sensor.bins), false);
    std::optional<std::size_t> own;
    for (std::size_t i = 0; i < observation.zones.size(); ++i) {
      const bool is_own = observation.zones[i].zone == z;
      if (is_own) own = i;
      if (!is_own && knowledge == Knowledge::fitted) continue;
      const auto here =
          lit_by_object(observation.zones[i], evaluation.object[i], scene.sensor.bins);
      for (std::size_t k = 0; k < lit.size(); ++k) lit[k] = lit[k] || here[k];
    }
    if (!own) continue;
    const ObservedZone& observed = observation.zones[*own];
    const BinLikelihood& noise_model = observation.noise_model(observed);
    const std::size_t count = observed.counts.size();
    const auto first = static_cast<std::size_t>(observed.first);
    DarkBins dark;
    if (scene.linear.direct == LinearMode::per_zone) dark.scale = evaluation.linear.direct[*own];
    if (!(dark.scale > 0)) continue;
    if (scene.linear.ambient == LinearMode::fixed) dark.level = scene.linear.fixed_ambient;
    std::vector<double> direct(count, 0.0);
    for (std::size_t k = 0; k < count && !evaluation.known.empty(); ++k) {
      const double background = zone.background_at(observed.first + static_cast<int>(k));
      direct[k] = dark.scale * (evaluation.known[*own][k] - background);
    }
    const double limit = kDarkShare * *std::ranges::max_element(direct);
    for (std::size_t k = 0; k < count; ++k) {
      const double beside =
          std::max(k > 0 ? direct[k - 1] : 0.0, k + 1 < count ? direct[k + 1] : 0.0);
      if (lit[first + k] || std::max(direct[k], beside) > limit) continue;
      const double n = observed.counts[k];
      const double mean = noise_model.lit(evaluation.mean[*own][k]);
      DarkCount one;
      one.bin = first + k;
      one.count = n - direct[k] - evaluation.linear.amplitude[*own] * evaluation.object[*own][k];
      one.direct = direct[k];
      one.variance = noise_model.variance(mean);
      one.cautious = noise_model.variance(std::max(mean, n));
      one.photons = noise_model.counts_photons() ? mean * noise_model.scale() : 0.0;
      one.clip = kClip * std::sqrt(noise_model.counts_photons() ? one.cautious : one.variance);
      dark.bins.push_back(one);
    }
    list.push_back(std::move(dark));
  }
  return list;
}

/// A bin over all captures in which it is dark.
struct BinMean {
  std::size_t captures = 0;
  double value = 0;     ///< above the level, at a scale of one
  double error = 0;     ///< standard error
  double ratio = 1;     ///< variance over the expected one
  double freedom = 1;   ///< degrees of freedom of the ratio
  double direct = 0;    ///< the modelled direct return
  double photons = 0;   ///< expected in all captures, where photons are counted
  double expected = 0;  ///< variance of the value that the noise model expects
};

/// What one bin holds above the level in one capture.
struct Sample {
  const DarkCount* dark;
  double value;    ///< at a scale of one
  double stretch;  ///< factor from the capture's scale to one

  double variance() const { return stretch * stretch * dark->variance; }
};

BinMean mean_of(const std::vector<Sample>& samples) {
  BinMean mean;
  mean.captures = samples.size();
  const double count = static_cast<double>(samples.size());
  std::vector<double> values;
  for (const Sample& s : samples) values.push_back(s.value);
  const double middle = median(values);
  for (double& value : values) value = std::abs(value - middle);
  // The standard deviation of a normal variable is 1.4826 median absolute deviations.
  const double scatter = 1.4826 * median(std::move(values));
  std::vector<double> clipped;
  double cautious = 0;
  for (const Sample& s : samples) {
    const double limit = std::max(kClip * scatter, s.stretch * s.dark->clip);
    clipped.push_back(std::clamp(s.value, middle - limit, middle + limit));
    mean.value += clipped.back() / count;
    mean.expected += s.variance() / (count * count);
    mean.direct += s.dark->direct / count;
    mean.photons += s.dark->photons;
    cautious += s.stretch * s.stretch * s.dark->cautious / (count * count);
  }
  if (samples.size() < kMinCaptures) {
    mean.error = std::sqrt(cautious);
    return mean;
  }
  double sum = 0;
  for (const double value : clipped) sum += std::pow(value - mean.value, 2);
  mean.error = std::sqrt(sum / (count * (count - 1)));
  // The ratio is taken over all captures together, because the ambient light of a single capture
  // says little where counts are sparse. Sparse counts also have a larger kurtosis than normal
  // ones.
  mean.ratio = sum / (count - 1) / (mean.expected * count);
  const double excess = mean.photons > 0 ? count / mean.photons : 0.0;
  mean.freedom = (count - 1) / (1 + excess / 2);
  return mean;
}

/// Means of a zone's bins over the captures, above the level of the bins without static light.
struct ZoneMeans {
  std::vector<BinMean> bins;  ///< [bins]
  std::vector<bool> lit;      ///< [bins] static light was found
  double level = 0;           ///< of the others, median over the captures
  double usual = 1;           ///< median over the bins of observed over expected variance
};

/// Level of a capture's bins without static light; nothing if there are too few of them.
std::optional<double> level_of(const DarkBins& capture, const std::vector<bool>& lit, bool first) {
  if (capture.level) return capture.level;
  std::vector<double> nothing;
  for (const DarkCount& dark : capture.bins) {
    if (!lit[dark.bin]) nothing.push_back(dark.count);
  }
  if (nothing.size() < kMinBins) return std::nullopt;
  // At first any bin may be lit, but the median holds while most are not.
  if (first) return median(std::move(nothing));
  return std::accumulate(nothing.begin(), nothing.end(), 0.0) / static_cast<double>(nothing.size());
}

/// `least` is the number of captures of which fewer say nothing about a bin.
ZoneMeans zone_means(const std::vector<DarkBins>& captures, int bins, std::size_t least) {
  const auto bin_count = static_cast<std::size_t>(bins);
  ZoneMeans means;
  means.lit.assign(bin_count, false);
  for (int turn = 0; turn < kTurns; ++turn) {
    std::vector<std::vector<Sample>> samples(bin_count);
    std::vector<double> levels;
    bool level_known = true;
    for (const DarkBins& capture : captures) {
      const std::optional<double> level = level_of(capture, means.lit, turn == 0);
      if (!level) continue;
      level_known = level_known && capture.level;
      levels.push_back(*level);
      const double stretch = 1 / capture.scale;
      for (const DarkCount& dark : capture.bins) {
        samples[dark.bin].push_back({&dark, stretch * (dark.count - *level), stretch});
      }
    }
    means.level = levels.empty() ? 0.0 : median(std::move(levels));
    means.bins.assign(bin_count, BinMean{});
    std::vector<double> offsets, ratios;
    for (std::size_t k = 0; k < bin_count; ++k) {
      if (samples[k].size() < least) continue;
      means.bins[k] = mean_of(samples[k]);
      if (!means.lit[k]) offsets.push_back(means.bins[k].value);
      if (samples[k].size() >= kMinCaptures) ratios.push_back(means.bins[k].ratio);
    }
    means.usual = ratios.empty() ? 1.0 : std::max(median(std::move(ratios)), 1e-12);
    // A level that is a median of small whole numbers is off by the same amount for all bins.
    const double offset = level_known || offsets.empty() ? 0.0 : median(std::move(offsets));
    for (std::size_t k = 0; k < bin_count; ++k) {
      BinMean& bin = means.bins[k];
      means.lit[k] = false;
      if (bin.captures == 0) continue;
      bin.value -= offset;
      bin.error = std::max(bin.error, std::sqrt(means.usual * bin.expected));
      means.lit[k] = std::abs(bin.value) > kFound * bin.error;
    }
  }
  return means;
}

/// Standard normal variable as improbable as a chi-square variable over its degrees of freedom
/// (Wilson and Hilferty 1931).
double normal_score(double ratio, double freedom) {
  const double variance = 2 / (9 * freedom);
  return (std::cbrt(ratio) - (1 - variance)) / std::sqrt(variance);
}

/// Light of the object that each bin of a zone holds in all captures, [bins].
std::vector<double> object_light(const CalibrationProblem& problem, const Evaluations& evaluations,
                                 int z) {
  std::vector<double> light(static_cast<std::size_t>(problem.base().sensor.bins), 0.0);
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    const Observation& observation = problem.observation(c);
    for (std::size_t i = 0; i < observation.zones.size(); ++i) {
      if (observation.zones[i].zone != z) continue;
      const std::vector<double>& object = evaluations[c].object[i];
      for (std::size_t k = 0; k < object.size(); ++k) {
        light[static_cast<std::size_t>(observation.zones[i].first) + k] += object[k];
      }
    }
  }
  return light;
}

/// The run of usable bins in [first, end) that holds most light; if none holds any, the longest.
TimeGate best_run(const std::vector<bool>& unusable, const std::vector<double>& light, int first,
                  int end) {
  TimeGate best;
  std::pair<double, int> most{-1, 0};
  TimeGate run{first, first};
  double sum = 0;
  for (int k = first; k < end; ++k) {
    if (unusable[static_cast<std::size_t>(k)]) {
      run = {k + 1, k + 1};
      sum = 0;
      continue;
    }
    run.end = k + 1;
    // Rounding can make the light slightly negative.
    sum += std::max(light[static_cast<std::size_t>(k)], 0.0);
    if (std::pair{sum, run.end - run.first} > most) {
      most = {sum, run.end - run.first};
      best = run;
    }
  }
  return best;
}

}  // namespace

std::vector<BackgroundBin> learn_background(const CalibrationProblem& problem,
                                            const Evaluations& evaluations,
                                            const std::vector<double>& keep, const Sensor& stated,
                                            Knowledge knowledge, Scene& scene) {
  bool any_object = false;
  for (std::size_t c = 0; c < problem.captures(); ++c) any_object |= problem.pose(c).has_value();
  std::vector<BackgroundBin> found;
  Sensor& sensor = scene.sensor;
  const bool photons = sensor.noise.counts_photons();
  for (int z = 0; z < sensor.zone_count(); ++z) {
    const auto index = static_cast<std::size_t>(z);
    Zone& zone = sensor.zones[index];
    if (zone.dead) continue;
    const ZoneMeans means = zone_means(dark_bins(problem, evaluations, keep, z, knowledge),
                                       sensor.bins, photons && !any_object ? 1 : kMinCaptures);
    zone.background = stated.zones[index].background;
    zone.background.resize(static_cast<std::size_t>(sensor.bins), 0.0);
    for (std::size_t k = 0; k < means.bins.size(); ++k) {
      const BinMean& bin = means.bins[k];
      if (bin.captures == 0) continue;
      zone.background[k] = 0;
      if (!means.lit[k] || (photons && bin.value < 0)) continue;
      zone.background[k] = bin.value;
      found.push_back({z, static_cast<int>(k), bin.value, bin.error});
    }
    if (std::ranges::all_of(zone.background, [](double counts) { return counts == 0; })) {
      zone.background.clear();
    }
  }
  return found;
}

void leave_out_unusable_bins(const CalibrationProblem& problem, const Evaluations& evaluations,
                             const std::vector<double>& keep, Scene& scene) {
  Sensor& sensor = scene.sensor;
  const bool photons = sensor.noise.counts_photons();
  // Counts that are cut off at zero have a variance that says nothing about a bin.
  const bool censored = make_likelihood(sensor.noise, 1, 1)->censored();
  for (int z = 0; z < sensor.zone_count(); ++z) {
    Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
    if (zone.dead) continue;
    const ZoneMeans means = zone_means(dark_bins(problem, evaluations, keep, z, Knowledge::fitted),
                                       sensor.bins, kMinCaptures);
    std::vector<bool> unusable(means.bins.size(), false);
    for (std::size_t k = 0; k < means.bins.size(); ++k) {
      const BinMean& bin = means.bins[k];
      if (bin.captures == 0 || (photons && bin.photons < kMinPhotons)) continue;
      const double ratio = bin.ratio / means.usual;
      const bool restless =
          !censored && ratio > kRestless && normal_score(ratio, bin.freedom) > kRestlessSigmas;
      const bool blind =
          means.lit[k] && means.level > 0 && bin.value + bin.direct < -0.5 * means.level;
      unusable[k] = restless || blind;
    }
    const int first = zone.first_valid_bin;
    const int end = sensor.valid_end(z);
    const TimeGate kept = best_run(unusable, object_light(problem, evaluations, z), first, end);
    zone.dead = kept.first == kept.end;
    if (zone.dead || kept.end - kept.first == end - first) continue;
    zone.first_valid_bin = kept.first;
    zone.last_valid_bin = kept.end - 1;
  }
}

}  // namespace blindcorner
