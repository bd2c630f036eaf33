// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/measured_comparison.h"

#include <algorithm>
#include <cmath>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/run_time.h"

namespace blindcorner {
namespace {

/// A row of the table as it grows from split to split.
struct Row {
  Condition condition;
  std::vector<std::vector<MethodAnswer>> answers;  ///< [methods][captures]

  void add(const std::vector<ComparedMethod>& methods, std::vector<Capture> captures) {
    std::vector<std::vector<MethodAnswer>> more = answer_all(methods, captures);
    answers.resize(methods.size());
    for (std::size_t m = 0; m < methods.size(); ++m) {
      std::ranges::move(more[m], std::back_inserter(answers[m]));
    }
    std::ranges::move(captures, std::back_inserter(condition.captures));
  }
};

std::vector<Capture> at(const std::vector<Capture>& captures,
                        const std::vector<std::size_t>& chosen) {
  std::vector<Capture> some;
  for (const std::size_t c : chosen) some.push_back(captures[c]);
  return some;
}

std::string description_of(const SplitScheme& scheme) {
  if (scheme.scheme == "folds") {
    return "Measured captures: learnt on all folds of positions but one, which is evaluated; each "
           "in turn.";
  }
  if (scheme.scheme == "few") {
    return "Learnt on a few positions of one fold only, all others are evaluated; each in turn.";
  }
  return "Learnt on one half of the volume, the other is evaluated.";
}

class Comparison {
 public:
  Comparison(const Scene& scene, const MeasuredCaptures& measured,
             const MeasuredComparisonOptions& options,
             const std::function<void(const std::string&)>& stage)
      : scene_(scene),
        measured_(measured),
        options_(options),
        stage_(stage),
        positions_(positions_of(scene, measured.captures)),
        sample_positions_(positions_of(scene, measured.samples)) {}

  SceneComparison run() {
    comparison_.scene = scene_.name;
    comparison_.unknowns = unknown_names(scene_);
    const auto schemes = split_schemes(positions_, comparison_.unknowns, options_.splits);
    for (const SplitScheme& scheme : schemes) run_scheme(scheme);
    if (comparison_.conditions.empty()) {
      throw Error(scene_.name + ": captures", "too few positions for any split");
    }
    return std::move(comparison_);
  }

 private:
  void run_scheme(const SplitScheme& scheme) {
    const bool with_samples = scheme.scheme == "folds" && !measured_.samples.empty();
    Row whole{{scheme.name, description_of(scheme), "", ""}, {}};
    Row sampled{{scheme.name + ", samples",
                 description_of(scheme) + " Evaluated on samples of fewer exposures.", "", ""},
                {}};
    std::vector<ComparedMethod> methods;
    for (std::size_t i = 0; i < scheme.splits.size(); ++i) {
      const PositionSplit& split = scheme.splits[i];
      const std::string name =
          scheme.name + (scheme.splits.size() > 1 ? ", " + std::to_string(i + 1) + " of " +
                                                        std::to_string(scheme.splits.size())
                                                  : std::string());
      methods = learn(split, name);
      say(name + ": answers");
      whole.add(methods, at(measured_.captures, split.evaluated(positions_)));
      if (with_samples)
        sampled.add(methods, at(measured_.samples, split.evaluated(sample_positions_)));
    }
    if (comparison_.methods.empty()) comparison_.methods = methods;
    for (const Row* row : {&whole, &sampled}) {
      if (row->condition.captures.empty()) continue;
      comparison_.conditions.push_back(
          compare(scene_, row->condition, methods, row->answers, options_.seed));
    }
  }

  /// All methods, after they have seen the captures to learn from.
  std::vector<ComparedMethod> learn(const PositionSplit& split, const std::string& name) {
    std::vector<Capture> known = at(measured_.captures, split.learn);
    say(name + ": calibration");
    const Stopwatch stopwatch;
    const Calibration calibration = calibrate(scene_, known, options_.calibration);
    const std::string learnt = std::to_string(known.size()) + " captures";
    std::vector<ComparedMethod> methods =
        untrained_methods(calibration.scene, options_.seed, options_.fit);
    for (ComparedMethod& method : methods) {
      if (&method != &methods.back()) {
        method.training = "calibrated with " + learnt + " in " + time_text(stopwatch.since_start());
      }
    }
    std::ranges::move(samples_of(known), std::back_inserter(known));
    for (const LearnedMethod& network : options_.networks) {
      say(name + ": " + network.name);
      methods.push_back(train(network, known));
    }
    return methods;
  }

  /// Samples at the positions of some captures.
  std::vector<Capture> samples_of(const std::vector<Capture>& captures) const {
    std::vector<std::string> keys;
    for (const Capture& capture : captures) keys.push_back(position_of(scene_, capture).key);
    std::ranges::sort(keys);
    std::vector<Capture> samples;
    for (std::size_t c = 0; c < measured_.samples.size(); ++c) {
      if (std::ranges::binary_search(keys, sample_positions_[c].key)) {
        samples.push_back(measured_.samples[c]);
      }
    }
    return samples;
  }

  ComparedMethod train(const LearnedMethod& network, const std::vector<Capture>& captures) const {
    const Stopwatch stopwatch;
    const CnnTrainingResult result = train_cnn(scene_, captures, network.training);
    const CnnBaseline cnn = CnnBaseline::parse(result.weights, network.name);
    return network_method(scene_, cnn, network.name,
                          std::to_string(captures.size()) + " captures, " +
                              std::to_string(result.history.size()) + " epochs in " +
                              time_text(stopwatch.since_start()) + "; weights after epoch " +
                              std::to_string(result.epoch),
                          options_.seed);
  }

  static std::string time_text(const RunTime& time) {
    const auto seconds = [](double s) { return std::to_string(std::lround(s)) + " s"; };
    return seconds(time.wall) + " (" + seconds(time.processor) + " of processor time)";
  }

  void say(const std::string& what) const {
    if (stage_) stage_(what);
  }

  const Scene& scene_;
  const MeasuredCaptures& measured_;
  const MeasuredComparisonOptions& options_;
  const std::function<void(const std::string&)>& stage_;
  std::vector<LabelledPosition> positions_, sample_positions_;
  SceneComparison comparison_;
};

}  // namespace

void MeasuredComparisonOptions::validate() const {
  splits.validate();
  calibration.validate();
  fit.validate();
  for (const LearnedMethod& network : networks) network.training.validate();
}

SceneComparison compare_measured(const Scene& scene, const MeasuredCaptures& measured,
                                 const MeasuredComparisonOptions& options,
                                 const std::function<void(const std::string&)>& stage) {
  options.validate();
  return Comparison(scene, measured, options, stage).run();
}

}  // namespace blindcorner
