// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/goodness_of_fit.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace blindcorner {
namespace {

/// Moments of the deviance of a Poisson count with mean mu: E[d], Var[d].
struct DevianceMoments {
  static constexpr double kLow = 1e-4, kHigh = 300;
  static constexpr int kSteps = 400;
  std::vector<double> mean, variance;

  DevianceMoments() {
    for (int i = 0; i <= kSteps; ++i) {
      const double mu = kLow * std::pow(kHigh / kLow, static_cast<double>(i) / kSteps);
      const int last = static_cast<int>(mu + 12 * std::sqrt(mu) + 30);
      double first = 0;
      double second = 0;
      double log_probability = -mu;
      for (int n = 0; n <= last; ++n) {
        if (n > 0) log_probability += std::log(mu / n);
        const double d = 2 * (n > 0 ? mu - n + n * std::log(n / mu) : mu);
        first += std::exp(log_probability) * d;
        second += std::exp(log_probability) * d * d;
      }
      mean.push_back(first);
      variance.push_back(second - first * first);
    }
  }

  void at(double mu, double& e, double& v) const {
    if (mu >= kHigh) {
      e = 1 + 1 / (6 * mu);
      v = 2;
      return;
    }
    const double x = std::max(std::log(mu / kLow) / std::log(kHigh / kLow) * kSteps, 0.0);
    const auto i = static_cast<std::size_t>(std::min(x, kSteps - 1.0));
    const double t = x - static_cast<double>(i);
    e = mean[i] * (1 - t) + mean[i + 1] * t;
    v = variance[i] * (1 - t) + variance[i + 1] * t;
    if (mu < kLow) {
      e *= mu / kLow;
      v *= mu / kLow;
    }
  }
};

const DevianceMoments& deviance_moments() {
  static const DevianceMoments moments;
  return moments;
}

/// Mean and variance of the deviance of a Gaussian-law count with mean m, by quadrature.
void gaussian_deviance_moments(const BinLikelihood& law, double m, double& e, double& v) {
  constexpr int kPoints = 24;
  const double sigma = std::sqrt(law.variance(m));
  double first = 0, second = 0, total = 0;
  for (int i = 0; i <= kPoints; ++i) {
    const double u = 8.0 * i / kPoints - 4;
    const double weight = std::exp(-0.5 * u * u);
    const double n = law.censored() ? std::max(m + sigma * u, 0.0) : m + sigma * u;
    const double d = 2 * (law.value(n, m) - law.least(n));
    first += weight * d;
    second += weight * d * d;
    total += weight;
  }
  e = first / total;
  v = second / total - e * e;
}

}  // namespace

GoodnessOfFit goodness_of_fit(const PoseObjective& objective, const Refined& optimum) {
  const Observation& observation = objective.solver().observation();
  GoodnessOfFit fit;
  ShapeBuffer at;
  objective.shapes(light_near(objective, optimum), optimum.pose, at);
  std::vector<double> mean;
  double variance = 0;
  const auto add = [&](const BinLikelihood& law, double m) {
    double e = 0;
    double v = 0;
    if (law.poisson()) {
      deviance_moments().at(std::max(law.scale() * m, 1e-12), e, v);
    } else {
      gaussian_deviance_moments(law, m, e, v);
    }
    fit.expected += e;
    variance += v;
  };
  for (std::size_t z = 0; z < observation.zones.size(); ++z) {
    const ObservedZone& zone = observation.zones[z];
    const BinLikelihood& law = observation.law(zone);
    mean.resize(zone.counts.size());
    objective.solver().expected(zone, at.shapes[z], optimum.linear.amplitude[z],
                                optimum.linear.ambient[z], optimum.linear.direct[z], mean.data());
    for (const double m : mean) add(law, m);
    if (law.poisson() && zone.outside_bins > 0)
      add(law, zone.outside_bins * optimum.linear.ambient[z]);
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
  const double excess = fit.deviance - fit.expected;
  fit.inflation = excess > 3 * fit.standard_deviation ? fit.deviance / fit.expected : 1.0;
  return fit;
}

}  // namespace blindcorner
