// SPDX-License-Identifier: Apache-2.0
#include "static_background.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "blindcorner/forward/quantile.h"

namespace blindcorner {
namespace {

using Evaluations = std::vector<CalibrationProblem::Evaluation>;

/// Light below this share of its zone's peak is no light: what it leaves is far below the noise of
/// any capture whose peak can be measured.
constexpr double kDark = 1e-3;
/// Captures of which fewer say nothing about a bin's scatter; photons have a law of their own.
constexpr std::size_t kLeastCaptures = 8;
/// Bins that hold nothing, of which fewer say nothing about a capture's level.
constexpr std::size_t kLeastBins = 3;
/// Standard errors by which static light refutes zero.
constexpr double kFound = 5.0;
/// Counts further off than this many standard deviations are taken as this far: one capture with
/// something in view must not make a background.
constexpr double kClip = 6.0;
/// Turns in which lit bins and the level of the others are told apart.
constexpr int kTurns = 4;
/// Variance over that of the zone's other bins at which a bin cannot be used ...
constexpr double kRestless = 2.0;
/// ... if that is this many standard deviations above one, of a chi-square variable.
constexpr double kRestlessSigmas = 8.0;

/// Counts of one zone in one capture, in bins without light of the object.
struct DarkBins {
  std::size_t capture = 0;
  std::vector<std::size_t> bins;  ///< counted from the first of the axis
  std::vector<double> counts;     ///< less the modelled direct return
  std::vector<double> variance;   ///< by the noise law, at the expected counts
  std::vector<double> cautious;   ///< the same, at the counts if they are more
  std::vector<double> excess;     ///< kurtosis of the counts beyond a normal distribution's
};

/// What a bin holds in each of the captures in which it is dark.
struct BinValues {
  std::vector<double> value, variance, cautious, excess;
};

/// Mean and its standard error of the values, clipped about their median.
struct Mean {
  double value = 0, error = 0;
  double square = 0;   ///< mean squared deviation over the variance expected
  double freedom = 1;  ///< degrees of freedom that the square has
};

Mean clipped_mean(const BinValues& bin) {
  const std::vector<double>& values = bin.value;
  const double middle = median(values);
  std::vector<double> away;
  for (const double value : values) away.push_back(std::abs(value - middle));
  const double scatter = 1.4826 * median(std::move(away));
  const double count = static_cast<double>(values.size());
  std::vector<double> clipped;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double limit = kClip * std::max(scatter, std::sqrt(bin.variance[i]));
    clipped.push_back(std::clamp(values[i], middle - limit, middle + limit));
  }
  Mean mean;
  mean.value = std::accumulate(clipped.begin(), clipped.end(), 0.0) / count;
  if (values.size() < kLeastCaptures) {
    mean.error = std::sqrt(std::accumulate(bin.cautious.begin(), bin.cautious.end(), 0.0)) / count;
    return mean;
  }
  double sum = 0, excess = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double off = clipped[i] - mean.value;
    sum += off * off;
    mean.square += off * off / bin.variance[i] / (count - 1);
    excess += bin.excess[i] / count;
  }
  mean.freedom = (count - 1) / (1 + excess / 2);
  mean.error = std::sqrt(sum / (count * (count - 1)));
  return mean;
}

/// Standard normal variable as improbable as a chi-square variable over its degrees of freedom
/// (Wilson and Hilferty 1931).
double normal_score(double ratio, double freedom) {
  const double variance = 2 / (9 * freedom);
  return (std::cbrt(ratio) - (1 - variance)) / std::sqrt(variance);
}

/// Zone `z` in all captures that are kept and have data there.
std::vector<DarkBins> dark_bins(const CalibrationProblem& problem, const Evaluations& evaluations,
                                const std::vector<double>& keep, int z) {
  const Zone& zone = problem.base().sensor.zones[static_cast<std::size_t>(z)];
  const auto background = [&](std::size_t bin) {
    return bin < zone.background.size() ? zone.background[bin] : 0.0;
  };
  std::vector<DarkBins> list;
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    if (keep[c] <= 0 || problem.capture(c).exposures_of(z) <= 0) continue;
    const Observation& observation = problem.observation(c);
    for (std::size_t i = 0; i < observation.zones.size(); ++i) {
      const ObservedZone& observed = observation.zones[i];
      if (observed.zone != z) continue;
      const std::size_t count = observed.counts.size();
      const auto first = static_cast<std::size_t>(observed.first);
      const double scale = evaluations[c].linear.direct[i];
      const std::vector<double>& object = evaluations[c].object[i];
      std::vector<double> direct(count, 0.0);
      if (!evaluations[c].known.empty()) {
        for (std::size_t k = 0; k < count; ++k) {
          direct[k] = scale * (evaluations[c].known[i][k] - background(first + k));
        }
      }
      const double object_limit = kDark * *std::ranges::max_element(object);
      const double direct_limit = kDark * *std::ranges::max_element(direct);
      // Nothing in the bin and its neighbours.
      const auto dark = [&](std::size_t k) {
        for (std::size_t n = k > 0 ? k - 1 : 0; n < std::min(k + 2, count); ++n) {
          if (object[n] > object_limit || direct[n] > direct_limit) return false;
        }
        return true;
      };
      DarkBins bins;
      bins.capture = c;
      for (std::size_t k = 0; k < count; ++k) {
        if (!dark(k)) continue;
        bins.bins.push_back(first + k);
        bins.counts.push_back(observed.counts[k] - direct[k]);
        const double mean = std::max(evaluations[c].mean[i][k], 1e-12);
        const BinLikelihood& law = observation.law(observed);
        bins.variance.push_back(law.variance(mean));
        bins.cautious.push_back(law.variance(std::max(mean, observed.counts[k])));
        bins.excess.push_back(law.poisson() ? 1 / (mean * law.scale()) : 0.0);
      }
      list.push_back(std::move(bins));
    }
  }
  return list;
}

/// Means of a zone's bins over the captures, above the level of those that hold nothing.
struct ZoneMeans {
  std::vector<Mean> bins;     ///< [bins]
  std::vector<double> count;  ///< [bins] captures
  std::vector<bool> lit;      ///< [bins] static light was found
  double level = 0;           ///< of the others, median over the captures
};

/// `least`: captures of which fewer say nothing.
ZoneMeans zone_means(const std::vector<DarkBins>& captures, std::size_t bin_count,
                     std::size_t least) {
  ZoneMeans means;
  means.lit.assign(bin_count, false);
  for (int turn = 0; turn < kTurns; ++turn) {
    std::vector<BinValues> values(bin_count);
    std::vector<double> levels;
    for (const DarkBins& capture : captures) {
      std::vector<double> nothing;
      for (std::size_t i = 0; i < capture.bins.size(); ++i) {
        if (!means.lit[capture.bins[i]]) nothing.push_back(capture.counts[i]);
      }
      if (nothing.size() < kLeastBins) continue;
      // At first any bin may be lit: the median of most of them holds.
      const double level = turn == 0 ? median(nothing)
                                     : std::accumulate(nothing.begin(), nothing.end(), 0.0) /
                                           static_cast<double>(nothing.size());
      levels.push_back(level);
      for (std::size_t i = 0; i < capture.bins.size(); ++i) {
        BinValues& bin = values[capture.bins[i]];
        bin.value.push_back(capture.counts[i] - level);
        bin.variance.push_back(capture.variance[i]);
        bin.cautious.push_back(capture.cautious[i]);
        bin.excess.push_back(capture.excess[i]);
      }
    }
    means.bins.assign(bin_count, Mean{});
    means.count.assign(bin_count, 0.0);
    means.level = levels.empty() ? 0.0 : median(std::move(levels));
    std::vector<double> offsets;
    for (std::size_t k = 0; k < bin_count; ++k) {
      if (values[k].value.size() < least) continue;
      means.count[k] = static_cast<double>(values[k].value.size());
      means.bins[k] = clipped_mean(values[k]);
      if (!means.lit[k]) offsets.push_back(means.bins[k].value);
    }
    if (offsets.empty()) {  // nothing is left to compare with
      means.lit.assign(bin_count, false);
      return means;
    }
    // A median of small whole numbers is off for all bins alike.
    const double offset = median(std::move(offsets));
    for (std::size_t k = 0; k < bin_count; ++k) {
      if (means.count[k] == 0) {
        means.lit[k] = false;
        continue;
      }
      means.bins[k].value -= offset;
      means.lit[k] = std::abs(means.bins[k].value) > kFound * means.bins[k].error;
    }
  }
  return means;
}

/// Light of the object that each bin of a zone holds in all captures, [bins].
std::vector<double> object_light(const CalibrationProblem& problem, const Evaluations& evaluations,
                                 int z, std::size_t bin_count) {
  std::vector<double> light(bin_count, 0.0);
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

/// The run of bins in [first, end) without an unusable one that holds most light; the longest if
/// none holds any.
BinWindow best_run(const std::vector<bool>& unusable, const std::vector<double>& light, int first,
                   int end) {
  BinWindow best;
  std::pair<double, int> most{-1, 0};
  BinWindow run{first, first};
  double sum = 0;
  for (int k = first; k < end; ++k) {
    if (unusable[static_cast<std::size_t>(k)]) {
      run = {k + 1, k + 1};
      sum = 0;
      continue;
    }
    run.end = k + 1;
    sum += light[static_cast<std::size_t>(k)];
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
                                            const std::vector<double>& keep, Scene& scene) {
  std::vector<BackgroundBin> found;
  Sensor& sensor = scene.sensor;
  const bool poisson = std::holds_alternative<PoissonNoise>(sensor.noise);
  for (int z = 0; z < sensor.zone_count(); ++z) {
    Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
    if (zone.dead) continue;
    const auto bins = static_cast<std::size_t>(sensor.bins);
    const ZoneMeans means =
        zone_means(dark_bins(problem, evaluations, keep, z), bins, poisson ? 1 : kLeastCaptures);
    zone.background.assign(bins, 0.0);
    bool any = false;
    for (std::size_t k = 0; k < means.bins.size(); ++k) {
      if (!means.lit[k] || (poisson && means.bins[k].value < 0)) continue;
      zone.background[k] = means.bins[k].value;
      found.push_back({z, static_cast<int>(k), means.bins[k].value, means.bins[k].error});
      any = true;
    }
    if (!any) zone.background.clear();
  }
  return found;
}

void leave_out_unusable_bins(const CalibrationProblem& problem, const Evaluations& evaluations,
                             const std::vector<double>& keep, Scene& scene) {
  Sensor& sensor = scene.sensor;
  for (int z = 0; z < sensor.zone_count(); ++z) {
    Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
    if (zone.dead) continue;
    const auto bins = static_cast<std::size_t>(sensor.bins);
    const ZoneMeans means =
        zone_means(dark_bins(problem, evaluations, keep, z), bins, kLeastCaptures);
    std::vector<double> squares;
    for (std::size_t k = 0; k < means.bins.size(); ++k) {
      if (means.count[k] > 0) squares.push_back(means.bins[k].square);
    }
    if (squares.empty()) continue;
    const double usual = std::max(median(std::move(squares)), 1e-12);
    std::vector<bool> unusable(bins, false);
    for (std::size_t k = 0; k < means.bins.size(); ++k) {
      if (means.count[k] == 0) continue;
      const double ratio = means.bins[k].square / usual;
      const bool restless =
          ratio > kRestless && normal_score(ratio, means.bins[k].freedom) > kRestlessSigmas;
      const bool blind =
          means.lit[k] && means.level > 0 && means.bins[k].value < -0.5 * means.level;
      unusable[k] = restless || blind;
    }
    const int first = zone.first_valid_bin;
    const int end = sensor.valid_end(z);
    const BinWindow kept =
        best_run(unusable, object_light(problem, evaluations, z, bins), first, end);
    zone.dead = kept.first == kept.end;
    if (zone.dead || kept.end - kept.first == end - first) continue;
    zone.first_valid_bin = kept.first;
    zone.last_valid_bin = kept.end - 1;
  }
}

}  // namespace blindcorner
