// SPDX-License-Identifier: Apache-2.0
/// `blindcorner crossvalidate SCENE CAPTURES -o DIR`: calibrate on some positions, evaluate on
/// others.
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/calibration/calibration.h"
#include "blindcorner/inverse/fit.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/report/result_file.h"
#include "commands/capture_inputs.h"
#include "commands/commands.h"
#include "commands/output_directory.h"
#include "commands/progress.h"
#include "report/evaluation_page.h"

namespace blindcorner {

namespace {

namespace fs = std::filesystem;

struct CrossvalidateArguments {
  std::string scene;
  std::string captures;
  std::string samples;
  std::string output;
  std::vector<std::string> schemes{"folds", "few", "halves"};
  int folds = 5;
  int few = 40;
  CalibrationOptions calibration;
  FitOptions fit;
};

/// A position by its true values, and its place in an order that depends on nothing else, so that
/// splits are the same whatever else is in the file.
struct Position {
  std::string key;
  std::uint64_t hash = 0;
  Eigen::VectorXd pose;
};

/// FNV-1a of the values in tenths of a millimetre (or of a milliradian).
std::uint64_t hash_of(const Eigen::VectorXd& pose) {
  std::uint64_t hash = 14695981039346656037ull;
  for (const double value : pose) {
    auto rounded = static_cast<std::int64_t>(std::llround(value * 1e4));
    for (int byte = 0; byte < 8; ++byte) {
      hash = (hash ^ static_cast<std::uint64_t>(rounded & 0xff)) * 1099511628211ull;
      rounded >>= 8;
    }
  }
  // Low bits of FNV are weak.
  return (hash ^ (hash >> 29)) * 0x9e3779b97f4a7c15ull >> 11;
}

Position position_of(const Scene& scene, const Capture& capture) {
  const std::vector<double> truth = truth_vector(scene, capture.truth);
  if (truth.empty() ||
      std::any_of(truth.begin(), truth.end(), [](double v) { return !std::isfinite(v); })) {
    throw Error(capture.source + " capture " + std::to_string(capture.index),
                "truth: accepted: the true value of every unknown");
  }
  Position position;
  position.pose =
      Eigen::Map<const Eigen::VectorXd>(truth.data(), static_cast<Eigen::Index>(truth.size()));
  position.hash = hash_of(position.pose);
  position.key = std::to_string(position.hash);
  return position;
}

struct Split {
  std::vector<std::size_t> calibrate;  ///< captures
  std::vector<std::string> evaluate;   ///< keys of positions
};

/// Folds of positions: calibrate on all but one and evaluate that, or calibrate on a few positions
/// of one and evaluate all others.
std::vector<Split> fold_splits(const std::vector<Position>& positions, int folds, int few) {
  std::vector<Split> splits;
  for (int f = 0; f < folds; ++f) {
    Split split;
    std::vector<std::size_t> own;
    for (std::size_t c = 0; c < positions.size(); ++c) {
      const bool inside =
          positions[c].hash % static_cast<std::uint64_t>(folds) == static_cast<std::uint64_t>(f);
      if (inside) own.push_back(c);
      if (few == 0 && !inside) split.calibrate.push_back(c);
      if (few == 0 && inside) split.evaluate.push_back(positions[c].key);
    }
    if (few > 0) {
      std::sort(own.begin(), own.end(), [&](std::size_t a, std::size_t b) {
        return positions[a].hash / 7 < positions[b].hash / 7;
      });
      own.resize(std::min(own.size(), static_cast<std::size_t>(few)));
      split.calibrate = own;
      for (std::size_t c = 0; c < positions.size(); ++c) {
        if (std::find(own.begin(), own.end(), c) == own.end()) {
          split.evaluate.push_back(positions[c].key);
        }
      }
    }
    if (!split.calibrate.empty() && !split.evaluate.empty()) splits.push_back(std::move(split));
  }
  return splits;
}

/// Below and above the median of one coordinate, each way.
std::vector<Split> half_splits(const std::vector<Position>& positions, Eigen::Index coordinate) {
  std::vector<double> values;
  for (const Position& p : positions) values.push_back(p.pose[coordinate]);
  std::nth_element(values.begin(), values.begin() + std::ssize(values) / 2, values.end());
  const double middle = values[values.size() / 2];
  std::vector<Split> splits(2);
  for (std::size_t c = 0; c < positions.size(); ++c) {
    const std::size_t half = positions[c].pose[coordinate] < middle ? 0 : 1;
    splits[half].calibrate.push_back(c);
    splits[1 - half].evaluate.push_back(positions[c].key);
  }
  return splits;
}

std::vector<Capture> read_all(const std::string& path, const Scene& scene) {
  const std::vector<CaptureInput> inputs = read_capture_inputs({path}, scene.sensor.bin_width);
  require_readable(inputs);
  std::vector<Capture> captures;
  for (const CaptureInput& input : inputs) {
    if (!input.capture) throw Error(input.source, input.error);
    captures.push_back(*input.capture);
  }
  return captures;
}

/// Fits the captures at the positions named and adds their errors.
void evaluate_split(const Scene& calibrated, const FitOptions& options,
                    const std::vector<Capture>& captures, const std::vector<Position>& positions,
                    const std::vector<std::string>& evaluate, std::vector<EstimateError>& errors) {
  std::vector<std::string> wanted = evaluate;
  std::sort(wanted.begin(), wanted.end());
  std::vector<std::size_t> chosen;
  for (std::size_t c = 0; c < captures.size(); ++c) {
    if (std::binary_search(wanted.begin(), wanted.end(), positions[c].key)) chosen.push_back(c);
  }
  const Fitter fitter(calibrated, options);
  std::vector<EstimateError> own(chosen.size());
  Progress progress("captures", chosen.size());
  tbb::parallel_for(
      std::size_t{0}, chosen.size(),
      [&](std::size_t i) {
        const FitResult result = fitter.fit(captures[chosen[i]]);
        own[i] = {pose_error(calibrated, result.posterior.mean, positions[chosen[i]].pose),
                  result.posterior.covariance, positions[chosen[i]].key};
        progress.advance();
      },
      tbb::simple_partitioner());
  std::move(own.begin(), own.end(), std::back_inserter(errors));
}

int run_crossvalidate(const CrossvalidateArguments& arguments) {
  arguments.calibration.validate();
  arguments.fit.validate();
  const Scene scene = read_scene(arguments.scene);
  const std::vector<Capture> captures = read_all(arguments.captures, scene);
  std::vector<Position> positions;
  for (const Capture& capture : captures) positions.push_back(position_of(scene, capture));
  std::vector<Capture> samples;
  std::vector<Position> sample_positions;
  if (!arguments.samples.empty()) {
    samples = read_all(arguments.samples, scene);
    for (const Capture& capture : samples) {
      sample_positions.push_back(position_of(scene, capture));
    }
  }
  make_directory(arguments.output);

  const std::vector<std::string> names = unknown_names(scene);
  std::vector<EvaluationRow> rows;
  const auto add = [&](const std::string& name, const std::vector<Split>& splits,
                       bool with_samples) {
    EvaluationRow row{name, {}, {}};
    EvaluationRow sampled{name + ", samples", {}, {}};
    for (const Split& split : splits) {
      std::vector<Capture> known;
      for (const std::size_t c : split.calibrate) known.push_back(captures[c]);
      const Calibration calibration = calibrate(scene, known, arguments.calibration);
      evaluate_split(calibration.scene, arguments.fit, captures, positions, split.evaluate,
                     row.errors);
      if (with_samples && !samples.empty()) {
        evaluate_split(calibration.scene, arguments.fit, samples, sample_positions, split.evaluate,
                       sampled.errors);
      }
      std::fprintf(stderr, "%s: %zu captures calibrated, variance scale %.2f, %zu left out\n",
                   name.c_str(), known.size(), calibration.variance_scale,
                   calibration.left_out.size());
    }
    for (EvaluationRow* r : {&row, &sampled}) {
      if (r->errors.empty()) continue;
      r->evaluation = evaluate_errors(r->errors, names);
      std::fputs(evaluation_text({*r}).c_str(), stdout);
      std::fflush(stdout);
      rows.push_back(std::move(*r));
    }
  };
  for (const std::string& scheme : arguments.schemes) {
    if (scheme == "folds") {
      add(std::to_string(arguments.folds) + " folds", fold_splits(positions, arguments.folds, 0),
          true);
    } else if (scheme == "few") {
      add("calibrated on " + std::to_string(arguments.few),
          fold_splits(positions, arguments.folds, arguments.few), false);
    } else {
      for (std::size_t i = 0; i < names.size(); ++i) {
        const auto splits = half_splits(positions, static_cast<Eigen::Index>(i));
        add("lower half of " + names[i] + " calibrated", {splits[0]}, false);
        add("upper half of " + names[i] + " calibrated", {splits[1]}, false);
      }
    }
  }
  if (rows.empty()) throw Error(arguments.captures, "too few positions for any split");
  const fs::path directory = arguments.output;
  write_atomically((directory / "index.html").string(),
                   evaluation_page("Cross-validation of " + scene.name, rows, names));
  write_atomically((directory / "evaluation.json").string(), evaluation_json(rows));
  return kAllWell;
}

}  // namespace

void add_crossvalidate_command(CLI::App& app, int& exit_code) {
  CLI::App& command = *app.add_subcommand(
      "crossvalidate", "calibrate on some positions, fit and evaluate the others");
  const auto arguments = std::make_shared<CrossvalidateArguments>();
  arguments->fit.empty_captures = 0;
  command.add_option("SCENE", arguments->scene, "scene file")->required();
  command.add_option("CAPTURES", arguments->captures, "captures with their truth")->required();
  command
      .add_option("-o,--output", arguments->output, "directory for page and table; made if missing")
      ->required()
      ->type_name("DIR");
  command
      .add_option("--samples", arguments->samples,
                  "other captures at the same positions, fitted with the folds' calibrations")
      ->type_name("CAPTURES");
  command
      .add_option("--schemes", arguments->schemes,
                  "folds: calibrate on all folds but one; few: on a few positions of one fold; "
                  "halves: on one half of the volume, along each coordinate and each way")
      ->check(CLI::IsMember({"folds", "few", "halves"}))
      ->delimiter(',');
  command.add_option("--folds", arguments->folds, "folds, by a hash of the true position")
      ->check(CLI::Range(2, 1000))
      ->capture_default_str();
  command.add_option("--few", arguments->few, "positions of the scheme `few`")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  command
      .add_option("--importance-samples", arguments->fit.importance_samples, "as `fit` takes it")
      ->capture_default_str();
  command
      .add_option("--outlier-probability", arguments->calibration.outlier_probability,
                  "as `calibrate` takes it")
      ->capture_default_str();
  command.callback([arguments, &exit_code] { exit_code = run_crossvalidate(*arguments); });
}

}  // namespace blindcorner
