// SPDX-License-Identifier: Apache-2.0
#include "inverse/calibration/capture_statistics.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "forward/support/quantile.h"

namespace blindcorner {

bool has_data(const Observation& observation, const ObservedZone& zone, double level) {
  // A zone with a ten thousandth of the exposures has this variance. By judgement: it holds no data
  // to speak of.
  constexpr double kProportion = 1e4;
  return observation.noise_model(zone).variance(level) <=
         kProportion * observation.likelihood.front()->variance(level);
}

double degrees_of_freedom(const Observation& observation) {
  double bins = 0;
  for (const ObservedZone& zone : observation.zones) {
    if (has_data(observation, zone, 1.0)) bins += zone.bins();
  }
  return std::max(bins, 1.0);
}

double total_deviance(const Evaluations& evaluations, const std::vector<double>& keep) {
  double total = 0;
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    if (keep[c] > 0) total += evaluations[c].deviance;
  }
  return total;
}

std::vector<double> huber_weights(const CalibrationProblem& problem, const Evaluations& evaluations,
                                  const std::vector<double>& keep, double sigmas) {
  std::vector<double> ratio;
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    if (keep[c] > 0) {
      ratio.push_back(evaluations[c].deviance / degrees_of_freedom(problem.observation(c)));
    }
  }
  const double usual = std::max(quantile(ratio, 0.5), 1e-12);
  std::vector<double> weights = keep;
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    const double bins = degrees_of_freedom(problem.observation(c));
    // Captures count less beyond half the distance at which they are left out.
    const double limit = usual * (bins + 0.5 * sigmas * std::sqrt(2 * bins));
    if (evaluations[c].deviance > limit) {
      weights[c] *= std::sqrt(limit / evaluations[c].deviance);
    }
  }
  return weights;
}

std::vector<double> fitting_captures(const CalibrationProblem& problem,
                                     const Evaluations& evaluations, double sigmas) {
  std::vector<double> ratio;
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    ratio.push_back(evaluations[c].deviance / degrees_of_freedom(problem.observation(c)));
  }
  const double usual = std::max(quantile(ratio, 0.5), 1e-12);
  std::vector<double> keep;
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    const double bins = degrees_of_freedom(problem.observation(c));
    keep.push_back(ratio[c] > usual * (1 + sigmas * std::sqrt(2 / bins)) ? 0.0 : 1.0);
  }
  return keep;
}

double typical_log_amplitude(const Evaluations& evaluations) {
  std::vector<double> logs;
  for (const auto& e : evaluations) {
    if (e.log_amplitude_error < 1) logs.push_back(e.log_amplitude);
  }
  if (logs.empty()) {
    for (const auto& e : evaluations) logs.push_back(e.log_amplitude);
  }
  return quantile(std::move(logs), 0.5);
}

double brightness_spread(const Evaluations& free, const std::vector<double>& keep) {
  // A brightness known to worse than 40 % says nothing about a spread of some per cent. A deviation
  // counts up to three standard deviations of its error and a spread of 14 % together, because one
  // capture must not set the spread. The weight is that of a square whose spread is 10 %. By
  // judgement: spreads of that order are expected.
  double sum = 0, weight = 0;
  for (std::size_t c = 0; c < free.size(); ++c) {
    const double error = free[c].log_amplitude_error;
    if (keep[c] <= 0 || error > 0.4) continue;
    const double excess =
        std::min(std::pow(free[c].log_amplitude, 2), 9 * (error * error + 0.02)) - error * error;
    const double w = 1 / std::pow(error * error + 0.01, 2);
    sum += w * excess;
    weight += w;
  }
  return weight > 0 ? std::sqrt(std::max(sum / weight, 0.0)) : 0.0;
}

}  // namespace blindcorner
