// SPDX-License-Identifier: Apache-2.0
/// `blindcorner cnn evaluate SCENE WEIGHTS CAPTURES... -o DIR`.
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/baseline/cnn_training.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/scene_file.h"
#include "commands/capture_inputs.h"
#include "commands/cnn.h"
#include "commands/commands.h"
#include "commands/output_directory.h"
#include "forward/support/quantile.h"
#include "report/cnn_page.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// The captures that the network's training held back. Throws Error if `captures` are not as many
/// as the training had.
std::vector<Capture> only_held_back(const std::vector<Capture>& captures, const CnnBaseline& cnn,
                                    const std::string& weights) {
  const CnnTrainingRecord& record = cnn.description().training;
  if (static_cast<std::size_t>(record.captures) != captures.size()) {
    throw Error(weights + ": metadata.training.captures",
                "trained on " + std::to_string(record.captures) + ", found " +
                    std::to_string(captures.size()) +
                    " captures, accepted with --held-back: the files that it was trained on");
  }
  return held_back_captures(captures, cnn);
}

}  // namespace

int run_cnn_evaluate(const CnnEvaluateArguments& arguments) {
  const Scene scene = read_scene(arguments.scene);
  const CnnBaseline cnn = CnnBaseline::load(arguments.weights);
  cnn.check_scene(scene);
  std::vector<Capture> captures = read_all_captures(arguments.captures, scene);
  if (arguments.held_back) captures = only_held_back(captures, cnn, arguments.weights);
  for (const Capture& capture : captures) check_cnn_capture(scene, capture);
  std::vector<PointEstimate> estimates;
  std::vector<double> times;  // ms
  for (const Capture& capture : captures) {
    const auto start = std::chrono::steady_clock::now();
    estimates.push_back(cnn_estimate(scene, capture, cnn));
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
    times.push_back(took.count());
  }
  const std::vector<ErrorFigures> figures = point_errors(scene, estimates);
  const double capture_ms = median(times);
  Json json;
  json["format"] = "blindcorner.cnn_evaluation/1";
  json["scene"] = scene.name;
  json["weights"] = arguments.weights;
  json["captures"] = captures.size();
  json["errors"] = point_errors_json(figures);
  json["time_ms"] = {{"capture_median", capture_ms}, {"capture_p90", quantile(times, 0.9)}};
  make_directory(arguments.output);
  const fs::path directory = arguments.output;
  write_atomically((directory / "estimates.csv").string(), point_estimates_csv(scene, estimates));
  write_atomically((directory / "evaluation.json").string(),
                   json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
  write_atomically((directory / "evaluation.html").string(),
                   cnn_evaluation_page(scene, cnn.description(), estimates, capture_ms));
  arguments.out.file((directory / "evaluation.json").string());
  arguments.out.text(
      "%zu captures, %.3g ms each (median; 90 %% within %.3g); errors in m and rad\n%s%s\n%s\n",
      captures.size(), capture_ms, quantile(times, 0.9), point_errors_text(figures).c_str(),
      (directory / "estimates.csv").c_str(), (directory / "evaluation.html").c_str());
  return kAllWell;
}

void add_cnn_evaluate(CLI::App& cnn, int& exit_code) {
  CLI::App& command = *cnn.add_subcommand(
      "evaluate",
      "errors of a trained network on captures with their truth; writes DIR/estimates.csv, "
      "evaluation.json and evaluation.html");
  const auto arguments = std::make_shared<CnnEvaluateArguments>();
  command.add_option("SCENE", arguments->scene, "scene file")->required();
  command.add_option("WEIGHTS", arguments->weights, "weights.pt of cnn train")->required();
  command.add_option("CAPTURES", arguments->captures, "capture files or directories of them")
      ->required();
  command
      .add_option("-o,--output", arguments->output, "directory for the results; made if missing")
      ->required()
      ->type_name("DIR");
  command.add_flag("--held-back", arguments->held_back,
                   "CAPTURES are what the network was trained on: only those held back");
  arguments->out.add_option(command, "evaluation.json");
  command.callback([arguments, &exit_code] { exit_code = run_cnn_evaluate(*arguments); });
}

}  // namespace blindcorner
