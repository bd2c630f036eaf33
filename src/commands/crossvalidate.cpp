// SPDX-License-Identifier: Apache-2.0
/// `blindcorner crossvalidate SCENE CAPTURES -o DIR`: calibrate on some positions, evaluate on
/// others.
#include <tbb/partitioner.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/calibration/calibration.h"
#include "blindcorner/inverse/fit.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/report/result_file.h"
#include "blindcorner/simulation/position_splits.h"
#include "commands/capture_inputs.h"
#include "commands/commands.h"
#include "commands/output_directory.h"
#include "commands/printout.h"
#include "commands/progress.h"
#include "forward/support/parallel.h"
#include "report/evaluation_page.h"

namespace blindcorner {

namespace {

namespace fs = std::filesystem;

struct CrossvalidateArguments {
  std::string scene;
  std::string captures;
  std::string samples;
  std::string output;
  SplitOptions splits;
  CalibrationOptions calibration;
  FitOptions fit;
  Printout out;
};

/// Fits the captures that the split evaluates and adds their errors.
void evaluate_split(const Scene& calibrated, const FitOptions& options,
                    const std::vector<Capture>& captures,
                    const std::vector<LabelledPosition>& positions, const PositionSplit& split,
                    std::vector<EstimateError>& errors) {
  const std::vector<std::size_t> chosen = split.evaluated(positions);
  const Fitter fitter(calibrated, options);
  std::vector<EstimateError> own(chosen.size());
  Progress progress("captures", chosen.size());
  parallel_for(
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
  const std::vector<Capture> captures = read_all_captures({arguments.captures}, scene);
  const std::vector<LabelledPosition> positions = positions_of(scene, captures);
  std::vector<Capture> samples;
  if (!arguments.samples.empty()) samples = read_all_captures({arguments.samples}, scene);
  const std::vector<LabelledPosition> sample_positions = positions_of(scene, samples);
  make_directory(arguments.output);

  const std::vector<std::string> names = unknown_names(scene);
  std::vector<EvaluationRow> rows;
  for (const auto& [scheme, name, splits] : split_schemes(positions, names, arguments.splits)) {
    EvaluationRow row{name, {}, {}};
    EvaluationRow sampled{name + ", samples", {}, {}};
    for (const PositionSplit& split : splits) {
      std::vector<Capture> known;
      for (const std::size_t c : split.learn) known.push_back(captures[c]);
      const Calibration calibration = calibrate(scene, known, arguments.calibration);
      evaluate_split(calibration.scene, arguments.fit, captures, positions, split, row.errors);
      if (scheme == "folds" && !samples.empty()) {
        evaluate_split(calibration.scene, arguments.fit, samples, sample_positions, split,
                       sampled.errors);
      }
      std::fprintf(stderr, "%s: %zu captures calibrated, variance scale %.2f, %zu left out\n",
                   name.c_str(), known.size(), calibration.variance_scale,
                   calibration.left_out.size());
    }
    for (EvaluationRow* r : {&row, &sampled}) {
      if (r->errors.empty()) continue;
      r->evaluation = evaluate_errors(r->errors, names);
      arguments.out.text("%s", evaluation_text({*r}).c_str());
      rows.push_back(std::move(*r));
    }
  }
  if (rows.empty()) throw Error(arguments.captures, "too few positions for any split");
  const fs::path directory = arguments.output;
  write_atomically((directory / "evaluation.html").string(),
                   evaluation_page("Cross-validation of " + scene.name, rows, names));
  write_atomically((directory / "evaluation.json").string(), evaluation_json(rows));
  arguments.out.document(evaluation_json(rows));
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
      .add_option("--schemes", arguments->splits.schemes,
                  "folds: calibrate on all folds but one; few: on a few positions of one fold; "
                  "halves: on one half of the volume, along each coordinate and each way")
      ->check(CLI::IsMember({"folds", "few", "halves"}))
      ->delimiter(',');
  command.add_option("--folds", arguments->splits.folds, "folds, by a hash of the true position")
      ->check(CLI::Range(2, 1000));
  command.add_option("--few", arguments->splits.few, "positions of the scheme `few`")
      ->check(CLI::Range(1, 1000000));
  command.add_option("--importance-samples", arguments->fit.importance_samples,
                     "as `fit` takes it");
  command.add_option("--outlier-probability", arguments->calibration.outlier_probability,
                     "as `calibrate` takes it");
  arguments->out.add_option(command, "evaluation.json");
  command.callback([arguments, &exit_code] { exit_code = run_crossvalidate(*arguments); });
}

}  // namespace blindcorner
