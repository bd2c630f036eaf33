// SPDX-License-Identifier: Apache-2.0
#include "inverse/calibration/noise_estimate.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "forward/support/quantile.h"
#include "inverse/calibration/capture_statistics.h"

namespace blindcorner {
namespace {

/// Least spread of the ambient light relative to its mean: daylight and lamps are no steadier over
/// the minutes that captures take.
constexpr double kAmbientSpread = 0.02;
/// Fewer levels of a zone's ambient light say nothing about their spread: of eight, the 95 % point
/// is the largest one.
constexpr std::size_t kMinLevels = 8;
/// Fewer squared residuals say nothing about the noise model: a hundred give its variance to 14 %
/// (root of 2 / 100).
constexpr std::size_t kMinSquares = 100;
/// Squared residuals beyond this many variances, three standard deviations, are left out of the
/// noise model ...
constexpr double kTrim = 9.0;
/// ... and those within have this mean, E[u^2 | u^2 < 9] of a standard normal u.
constexpr double kTrimmedMean = 0.9733;
/// Expected counts below this are too skewed to be trimmed like normal ones: at five, one in 200
/// lies beyond three standard deviations, twice as many as for a normal variable.
constexpr double kFewCounts = 5;
/// Median of chi-square with one degree of freedom, and the 97.5 % point of a normal variable.
constexpr double kMedianSquare = 0.455;
constexpr double kNormalPoint = 1.96;

/// A squared residual, scaled to one exposure.
struct Square {
  std::size_t zone;
  double mean, square;
  double counts;  ///< expected in all of the capture's exposures
};

std::vector<Square> squared_residuals(const CalibrationProblem& problem,
                                      const Evaluations& evaluations,
                                      const std::vector<double>& keep, const Scene& scene) {
  std::vector<Square> squares;
  const double captures = std::accumulate(keep.begin(), keep.end(), 0.0);
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    if (keep[c] <= 0) continue;
    const Observation& observation = problem.observation(c);
    for (std::size_t i = 0; i < observation.zones.size(); ++i) {
      const ObservedZone& zone = observation.zones[i];
      const double exposures = problem.capture(c).exposures_of(zone.zone);
      if (exposures <= 0) continue;
      const auto index = static_cast<std::size_t>(zone.zone);
      // Degrees of freedom that the fitted ambient light took away.
      double lost = 0;
      if (scene.linear.ambient == LinearMode::per_zone) {
        const BinLikelihood& noise_model = observation.noise_model(zone);
        const double own =
            noise_model.variance(noise_model.lit(evaluations[c].linear.ambient[i])) / zone.bins();
        const auto& priors = scene.linear.ambient_prior;
        const double prior = priors.empty() ? 1e300 : std::pow(priors[index].sigma, 2);
        lost = prior / (prior + own);
      }
      const double correction = zone.bins() / std::max(zone.bins() - lost, 0.5);
      for (std::size_t k = 0; k < zone.counts.size(); ++k) {
        // A mean over the captures was subtracted from bins with a background.
        const int bin = zone.first + static_cast<int>(k);
        const bool fitted = scene.sensor.zones[index].background_at(bin) != 0;
        if (fitted && captures < 2) continue;
        const double left = fitted ? captures / (captures - 1) : 1.0;
        const double r = zone.counts[k] - evaluations[c].mean[i][k];
        const double mean = std::max(evaluations[c].mean[i][k], 0.0);
        squares.push_back({index, mean, r * r * exposures * correction * left, mean * exposures});
      }
    }
  }
  return squares;
}

/// Mean of those squared residuals of Poisson counts, divided by the expected count, that are below
/// kTrim. It is 0.94 for five counts, which are skewed, and kTrimmedMean for many.
class PoissonTrim {
 public:
  PoissonTrim() {
    for (int i = 0; i < kPoints; ++i) table_[static_cast<std::size_t>(i)] = exact(counts_at(i));
  }

  double mean_square(double counts) const {
    const double place = std::log(std::max(counts, kLeast) / kLeast) / std::log(kMost / kLeast);
    if (place >= 1) return kTrimmedMean;
    return table_[static_cast<std::size_t>(std::lround(place * (kPoints - 1)))];
  }

 private:
  /// Half a per cent from one point to the next.
  static constexpr double kLeast = 1, kMost = 1000;
  static constexpr int kPoints = 1400;

  static double counts_at(int i) { return kLeast * std::pow(kMost / kLeast, i / (kPoints - 1.0)); }
  static double exact(double counts) {
    const double reach = std::sqrt(kTrim * counts);
    double sum = 0, weights = 0;
    for (double n = std::max(std::ceil(counts - reach), 0.0); n <= counts + reach; ++n) {
      const double weight = std::exp(n * std::log(counts) - counts - std::lgamma(n + 1));
      sum += weight * (n - counts) * (n - counts) / counts;
      weights += weight;
    }
    return weights > 0 ? sum / weights : kTrimmedMean;
  }

  std::array<double, kPoints> table_{};
};

/// Variance per count. Each bin has the same weight. In a ratio of sums, a few bright bins would
/// stand for all, although the fitted gains and times have taken up their residuals (a capture of a
/// wall without an object gave 0.64 to 0.84).
double trimmed_dispersion(const std::vector<Square>& squares, double dispersion) {
  struct Ratio {
    double value, counts;
  };
  std::vector<Ratio> ratios;
  double square = 0, mean = 0;
  for (const Square& s : squares) {
    square += s.square;
    mean += s.mean;
    if (s.counts >= kFewCounts * dispersion) ratios.push_back({s.square / s.mean, s.counts});
  }
  if (ratios.size() < kMinSquares) return mean > 0 && square > 0 ? square / mean : dispersion;
  static const PoissonTrim trim;
  // Which residuals are trimmed depends on the result, and each turn brings it closer. The number
  // of turns is by judgement.
  for (int i = 0; i < 20; ++i) {
    double sum = 0, expected = 0;
    for (const Ratio& ratio : ratios) {
      if (ratio.value > kTrim * dispersion) continue;
      sum += ratio.value;
      expected += trim.mean_square(ratio.counts / dispersion);
    }
    if (expected > 0 && sum > 0) dispersion = sum / expected;
  }
  return dispersion;
}

/// Floor of each group and the slope that they share, [groups + 1], by reweighted least squares;
/// none is negative. `group` is [zones].
Eigen::VectorXd trimmed_law(const std::vector<Square>& squares, const std::vector<int>& group,
                            Eigen::VectorXd law) {
  const Eigen::Index groups = law.size() - 1;
  for (int i = 0; i < 30; ++i) {  // as above
    Eigen::MatrixXd h = Eigen::MatrixXd::Zero(groups + 1, groups + 1);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(groups + 1);
    for (const Square& s : squares) {
      const Eigen::Index own = group[s.zone];
      const double v = law[own] + law[groups] * s.mean;
      if (s.square > kTrim * v) continue;
      const double weight = 1 / (v * v);
      h(own, own) += weight;
      h(own, groups) += weight * s.mean;
      h(groups, groups) += weight * s.mean * s.mean;
      g[own] += weight * s.square / kTrimmedMean;
      g[groups] += weight * s.mean * s.square / kTrimmedMean;
    }
    // The slope with the floors eliminated, then the floors, and then the slope once more in case a
    // floor had to be raised: a variance must not vanish, and a thousandth of the level is as good
    // as none.
    const auto floors = [&](double slope) {
      for (Eigen::Index k = 0; k < groups; ++k) {
        if (h(k, k) <= 0) continue;
        const double level = g[k] / h(k, k);
        law[k] = std::max(level - slope * h(k, groups) / h(k, k), 1e-3 * level);
      }
    };
    double numerator = g[groups];
    double denominator = h(groups, groups);
    for (Eigen::Index k = 0; k < groups; ++k) {
      if (h(k, k) <= 0) continue;
      numerator -= g[k] * h(k, groups) / h(k, k);
      denominator -= h(k, groups) * h(k, groups) / h(k, k);
    }
    floors(denominator > 1e-12 * h(groups, groups) ? std::max(numerator / denominator, 0.0) : 0.0);
    const double rest = g[groups] - law.head(groups).dot(h.col(groups).head(groups));
    law[groups] = h(groups, groups) > 0 ? std::max(rest / h(groups, groups), 0.0) : 0.0;
  }
  return law;
}

}  // namespace

void learn_ambient(const CalibrationProblem& problem, const Evaluations& flat,
                   const std::vector<double>& keep, Scene& scene) {
  if (scene.linear.ambient != LinearMode::per_zone) return;
  const std::size_t zones = scene.sensor.zones.size();
  std::vector<std::vector<double>> levels(zones), variances(zones);
  for (std::size_t c = 0; c < flat.size(); ++c) {
    if (keep[c] <= 0) continue;
    const Observation& observation = problem.observation(c);
    for (std::size_t i = 0; i < observation.zones.size(); ++i) {
      const ObservedZone& zone = observation.zones[i];
      const double level = flat[c].linear.ambient[i];
      const BinLikelihood& noise_model = observation.noise_model(zone);
      const double lit = noise_model.lit(level);
      if (!has_data(observation, zone, lit)) continue;
      levels[static_cast<std::size_t>(zone.zone)].push_back(level);
      variances[static_cast<std::size_t>(zone.zone)].push_back(noise_model.variance(lit) /
                                                               zone.bins());
    }
  }
  std::vector<NormalPrior> priors(zones, NormalPrior{0, 1e6});
  for (std::size_t z = 0; z < zones; ++z) {
    if (levels[z].size() < kMinLevels) {
      if (!scene.sensor.zones[z].dead) return;  // too few to say anything about a spread
      continue;
    }
    const double middle = quantile(levels[z], 0.5);
    std::vector<double> away;
    for (const double level : levels[z]) away.push_back(std::abs(level - middle));
    const double spread = quantile(std::move(away), 0.95) / kNormalPoint;
    const double noise = quantile(variances[z], 0.5);
    priors[z] = {middle,
                 std::sqrt(std::max(spread * spread - noise,
                                    std::pow(kAmbientSpread * std::abs(middle), 2) + 1e-12))};
  }
  scene.linear.ambient_prior = std::move(priors);
}

void learn_noise(const CalibrationProblem& problem, const Evaluations& evaluations,
                 const std::vector<double>& keep, Scene& scene) {
  const std::vector<Square> squares = squared_residuals(problem, evaluations, keep, scene);
  if (squares.size() < kMinSquares) return;
  Sensor& sensor = scene.sensor;
  if (!sensor.noise.stated_line()) {
    sensor.dispersion = trimmed_dispersion(squares, sensor.dispersion);
    return;
  }
  std::vector<std::size_t> count(sensor.zones.size());
  for (const Square& s : squares) ++count[s.zone];
  std::vector<int> group(sensor.zones.size(), 0);  // 0: zones with few residuals
  int groups = 1;
  for (std::size_t z = 0; z < count.size(); ++z) {
    if (count[z] >= kMinSquares) group[z] = groups++;
  }
  // The start has half of the squares on either side, so that a poor guess does not trim
  // everything.
  const auto before = [&](std::size_t zone) {
    return *sensor.noise_of(static_cast<int>(zone)).stated_line();
  };
  std::vector<double> ratio;
  for (const Square& s : squares) {
    const VarianceLine own = before(s.zone);
    ratio.push_back(s.square / (own.floor + own.per_count * s.mean));
  }
  const double scale = quantile(std::move(ratio), 0.5) / kMedianSquare;
  VarianceLine line = *sensor.noise.stated_line();
  Eigen::VectorXd law(groups + 1);
  law[0] = line.floor * scale;
  law[groups] = line.per_count * scale;
  for (std::size_t z = 0; z < group.size(); ++z) {
    if (group[z] > 0) law[group[z]] = before(z).floor * scale;
  }
  law = trimmed_law(squares, group, law);
  line.per_count = law[groups];
  if (groups > 1) line.floor = law.segment(1, groups - 1).mean();
  if (std::ranges::any_of(squares, [&](const Square& s) { return group[s.zone] == 0; })) {
    line.floor = law[0];
  }
  sensor.noise.state_line(line);
  for (std::size_t z = 0; z < group.size(); ++z) {
    if (group[z] > 0) sensor.zones[z].variance_floor = law[group[z]];
  }
}

}  // namespace blindcorner
