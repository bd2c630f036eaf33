// SPDX-License-Identifier: Apache-2.0
#include "inverse/calibration/calibration_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "inverse/calibration/capture_statistics.h"
#include "inverse/calibration/static_background.h"

namespace blindcorner {
namespace {

/// Says where a capture is farthest from the model, and whether that is before any light that the
/// object can send by way of the relay (up to there, the object's light is below a thousandth of
/// its peak in the zone).
std::string worst_bin_text(const Observation& observation,
                           const CalibrationProblem::Evaluation& evaluation) {
  double worst = 0;
  std::string text;
  for (std::size_t i = 0; i < observation.zones.size(); ++i) {
    const ObservedZone& zone = observation.zones[i];
    const std::vector<double>& light = evaluation.object[i];
    const double least = kDarkShare * *std::ranges::max_element(light);
    bool early = true;
    for (std::size_t k = 0; k < zone.counts.size(); ++k) {
      early = early && light[k] <= least;
      const double mean = evaluation.mean[i][k];
      const double off = zone.counts[k] - mean;
      const BinLikelihood& noise_model = observation.noise_model(zone);
      const double square = off * off / noise_model.variance(noise_model.lit(mean));
      if (square <= worst) continue;
      worst = square;
      char line[160];
      std::snprintf(line, sizeof line, "; most in zone %d, bin %zu: %.4g counts where %.4g fit%s",
                    zone.zone, static_cast<std::size_t>(zone.first) + k, zone.counts[k], mean,
                    early && least > 0 && off > 0
                        ? ", before the object's light can arrive (in direct view?)"
                        : "");
      text = line;
    }
  }
  return text;
}

}  // namespace

std::string valid_bins_note(const std::vector<Zone>& stated, const Sensor& sensor) {
  std::map<std::string, std::string> zones;  // by what is said of them
  for (int z = 0; z < sensor.zone_count(); ++z) {
    const Zone& was = stated[static_cast<std::size_t>(z)];
    const Zone& now = sensor.zones[static_cast<std::size_t>(z)];
    const int was_last = was.last_valid_bin < 0 ? sensor.bins - 1 : was.last_valid_bin;
    const int now_last = sensor.valid_end(z) - 1;
    if (was.dead == now.dead && was.first_valid_bin == now.first_valid_bin &&
        was_last == now_last) {
      continue;
    }
    const auto range = [](int first, int last) {
      return std::to_string(first) + " to " + std::to_string(last);
    };
    zones[(now.dead ? "none" : range(now.first_valid_bin, now_last)) + " (stated " +
          range(was.first_valid_bin, was_last) + ")"] += " " + std::to_string(z);
  }
  std::string line;
  for (const auto& [bins, of] : zones) {
    line += (line.empty() ? "valid bins: " : "; ") + bins + " in zones" + of;
  }
  return line;
}

std::vector<CalibratedParameter> estimates(const CalibrationProblem& problem,
                                           const Eigen::VectorXd& u,
                                           const Eigen::MatrixXd& covariance) {
  std::vector<CalibratedParameter> list;
  for (std::size_t i = 0; i < problem.parameters().size(); ++i) {
    const InstrumentParameter& p = problem.parameters()[i];
    const auto k = static_cast<Eigen::Index>(i);
    const double factor = p.logarithmic ? 1 : p.unit;
    list.push_back({p.name, p.prior, factor * p.sigma, p.value(u[k]),
                    factor * (p.fixed ? p.sigma : std::sqrt(covariance(k, k))), p.logarithmic,
                    !p.fixed});
  }
  return list;
}

void tell_captures(const Sensor& sensor, const CalibrationProblem& problem,
                   const Evaluations& evaluations, const std::vector<double>& keep,
                   Calibration& result) {
  for (std::size_t c = 0; c < keep.size(); ++c) {
    const double bins = degrees_of_freedom(problem.observation(c));
    if (keep[c] > 0) {
      ++result.used;
      result.expected_deviance += bins;
      continue;
    }
    if (saturates(sensor, problem.capture(c))) {
      result.left_out.push_back({static_cast<int>(c), "saturates in bins where others do not"});
      continue;
    }
    char text[96];
    std::snprintf(text, sizeof text, "does not fit: deviance %.0f where about %.0f is usual",
                  evaluations[c].deviance, bins);
    result.left_out.push_back(
        {static_cast<int>(c), text + worst_bin_text(problem.observation(c), evaluations[c])});
  }
}

std::vector<CalibrationView> views(const CalibrationProblem& problem, const Evaluations& before,
                                   const Evaluations& after, const std::vector<double>& keep) {
  std::vector<CalibrationView> list;
  const Sensor& sensor = problem.base().sensor;
  for (int z = 0; z < sensor.zone_count(); ++z) {
    const auto bins = static_cast<std::size_t>(2 * sensor.bins);
    std::vector<double> measured(bins), old(bins), fitted(bins), count(bins);
    for (std::size_t c = 0; c < problem.captures(); ++c) {
      if (keep[c] <= 0 || problem.capture(c).exposures_of(z) <= 0) continue;
      const Observation& observation = problem.observation(c);
      for (std::size_t i = 0; i < observation.zones.size(); ++i) {
        const ObservedZone& zone = observation.zones[i];
        if (zone.zone != z) continue;
        std::ptrdiff_t center = zone.bins() / 2;
        const auto& light = after[c].object[i];
        const auto brightest = std::max_element(light.begin(), light.end());
        if (brightest != light.end() && *brightest > 0) center = brightest - light.begin();
        for (std::size_t k = 0; k < zone.counts.size(); ++k) {
          const auto at =
              static_cast<std::size_t>(static_cast<std::ptrdiff_t>(k) - center + sensor.bins);
          const double known =
              after[c].linear.direct[i] * sensor.zones[static_cast<std::size_t>(z)].background_at(
                                              zone.first + static_cast<int>(k));
          measured[at] += zone.counts[k] - known;
          old[at] += before[c].mean[i][k] - known;
          fitted[at] += after[c].mean[i][k] - known;
          count[at] += 1;
        }
      }
    }
    CalibrationView view;
    view.zone = z;
    const double most = *std::max_element(count.begin(), count.end());
    for (std::size_t k = 0; k < bins && most > 0; ++k) {
      if (count[k] < 0.3 * most) continue;  // by judgement: means of few captures are noise
      view.measured.push_back(measured[k] / count[k]);
      view.before.push_back(old[k] / count[k]);
      view.after.push_back(fitted[k] / count[k]);
    }
    if (!view.measured.empty()) list.push_back(std::move(view));
  }
  return list;
}

}  // namespace blindcorner
