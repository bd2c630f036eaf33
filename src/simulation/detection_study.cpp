// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/detection_study.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

/// Stated false-alarm probabilities that are checked.
constexpr double kStated[] = {0.5, 0.1, 0.05, 0.01};
constexpr std::uint64_t kShownSeed = 1'000'003, kEmptySeed = 2'147'483'659;

DetectionTrial detect(const Fitter& fitter, const Capture& capture) {
  const FitResult result = fitter.fit(capture);
  DetectionTrial trial;
  trial.presence = result.posterior.presence_probability;
  trial.false_alarm = result.false_alarm_probability.value_or(1);
  trial.reported = std::ranges::find(result.flags, "nothing_detected") == result.flags.end();
  if (!std::isfinite(trial.presence) || !std::isfinite(trial.false_alarm)) {
    throw Error("result", "found a value that is not finite");
  }
  return trial;
}

std::vector<double> scores_of(std::span<const DetectionTrial> trials,
                              double (*score)(const DetectionTrial&)) {
  std::vector<double> scores;
  for (const DetectionTrial& t : trials) {
    if (t.error.empty()) scores.push_back(score(t));
  }
  return scores;
}

std::vector<RocPoint> curve_of(const DetectionLevel& level,
                               double (*score)(const DetectionTrial&)) {
  return roc_curve(scores_of(level.with, score), scores_of(level.without, score));
}

int reported_among(std::span<const DetectionTrial> trials) {
  return static_cast<int>(std::ranges::count_if(
      trials, [](const DetectionTrial& t) { return t.error.empty() && t.reported; }));
}

void summarise_detection(DetectionLevel& level) {
  level.by_presence = curve_of(level, [](const DetectionTrial& t) { return t.presence; });
  level.by_false_alarm = curve_of(level, [](const DetectionTrial& t) { return -t.false_alarm; });
  level.failures = failures_of(level.with) + failures_of(level.without);
  level.reported_with = reported_among(level.with);
  level.reported_without = reported_among(level.without);
  const std::vector<double> stated =
      scores_of(level.without, [](const DetectionTrial& t) { return t.false_alarm; });
  const auto count = static_cast<int>(stated.size());
  for (const double p : kStated) {
    const auto below = std::ranges::count_if(stated, [p](double value) { return value < p; });
    char what[64];
    std::snprintf(what, sizeof what, "false-alarm probability below %g", p);
    level.claims.push_back(
        {what, ClaimKind::share, p, count > 0 ? static_cast<double>(below) / count : 0, count});
  }
}

}  // namespace

void DetectionOptions::validate() const {
  ClaimStudyOptions::validate();
  const auto require = [](bool condition, const char* field, const char* accepted) {
    if (!condition)
      throw Error(std::string("DetectionOptions.") + field, std::string("accepted: ") + accepted);
  };
  require(empty_captures >= 1, "empty_captures", "at least 1");
  require(!photons.empty(), "photons", "at least one");
  require(fit.empty_captures > 0, "fit.empty_captures",
          "above 0: without, no false-alarm probability is stated");
}

std::vector<RocPoint> roc_curve(std::span<const double> with, std::span<const double> without) {
  std::vector<double> present(with.begin(), with.end()), absent(without.begin(), without.end());
  std::ranges::sort(present, std::greater{});
  std::ranges::sort(absent, std::greater{});
  std::vector<RocPoint> curve{{0, 0}};
  std::size_t hits = 0, alarms = 0;
  while (hits < present.size() || alarms < absent.size()) {
    double threshold = 0;
    if (hits == present.size()) {
      threshold = absent[alarms];
    } else if (alarms == absent.size()) {
      threshold = present[hits];
    } else {
      threshold = std::max(present[hits], absent[alarms]);
    }
    while (hits < present.size() && present[hits] >= threshold) ++hits;
    while (alarms < absent.size() && absent[alarms] >= threshold) ++alarms;
    const auto share = [](std::size_t part, std::size_t whole) {
      return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 1.0;
    };
    curve.push_back({share(alarms, absent.size()), share(hits, present.size())});
  }
  return curve;
}

double area_below(std::span<const RocPoint> curve) {
  double area = 0;
  for (std::size_t i = 1; i < curve.size(); ++i) {
    area += 0.5 * (curve[i].true_share + curve[i - 1].true_share) *
            (curve[i].false_share - curve[i - 1].false_share);
  }
  return area;
}

double true_share_at(std::span<const RocPoint> curve, double false_share) {
  for (std::size_t i = 1; i < curve.size(); ++i) {
    const RocPoint &a = curve[i - 1], &b = curve[i];
    if (b.false_share <= false_share) continue;
    const double part = (false_share - a.false_share) / (b.false_share - a.false_share);
    return a.true_share + part * (b.true_share - a.true_share);
  }
  return curve.empty() ? 0 : curve.back().true_share;
}

DetectionScene study_detection(const Scene& scene, const DetectionOptions& options,
                               const std::function<void()>& advance) {
  options.validate();
  const std::vector<DrawnObject> objects = draw_objects(scene, draw_options(options));
  const HistogramCube empty_light = empty_static_background(scene);
  const auto empty = static_cast<std::size_t>(options.empty_captures);
  const Fitter fitter(scene, options.fit);
  DetectionScene study{scene, {}};
  add_levels(light_levels(scene, options), study, [&](DetectionLevel& level) {
    level.with = answered_trials(objects.size(), advance, [&](std::size_t i) {
      return detect(
          fitter, capture_of(scene, objects[i], level.exposure, level.seed + kShownSeed * (i + 1)));
    });
    level.without = answered_trials(empty, advance, [&](std::size_t i) {
      return detect(fitter, empty_capture(scene, empty_light, level.exposure,
                                          level.seed + kEmptySeed * (i + 1)));
    });
    summarise_detection(level);
  });
  return study;
}

}  // namespace blindcorner
