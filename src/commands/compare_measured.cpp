// SPDX-License-Identifier: Apache-2.0
/// `blindcorner compare SCENE --measured CAPTURES`: each method learns some, all answer the others.
#include <CLI/CLI.hpp>
#include <cstdio>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/scene_file.h"
#include "commands/capture_inputs.h"
#include "commands/commands.h"
#include "commands/compare.h"
#include "commands/number_check.h"

namespace blindcorner {
namespace {

std::vector<LearnedMethod> networks_of(const CompareArguments& arguments) {
  std::vector<LearnedMethod> networks;
  if (!CnnBaseline::available()) {
    std::fputs("blindcorner: networks are left out: libtorch is missing (docs/cnn.md)\n", stderr);
    return networks;
  }
  for (const std::string& name : arguments.trained) {
    const CnnArchitecture architecture = parse_cnn_architecture(name, "--train");
    LearnedMethod network{name + " network", CnnTrainingOptions::of(architecture)};
    network.training.epochs = arguments.epochs;
    network.training.early_stopping = arguments.early_stopping;
    network.training.seed = arguments.options.seed;
    networks.push_back(std::move(network));
  }
  return networks;
}

/// Parses "network=0.255": the name, and its RMSE in m.
PublishedFigure published_figure(const std::string& text) {
  const std::size_t equals = text.find('=');
  double value = 0;
  const bool good = equals != std::string::npos && equals > 0 &&
                    CLI::detail::lexical_cast(text.substr(equals + 1), value) && value > 0;
  if (!good) throw Error("--published", "found " + text + ", accepted: NAME=RMSE in metres");
  return {text.substr(0, equals), value};
}

}  // namespace

void add_measured_options(CLI::App& command, CompareArguments& arguments) {
  const auto measured =
      command
          .add_option("--measured", arguments.measured,
                      "captures with their truth, measured in the one scene given: methods learn "
                      "or are calibrated with some positions and answer the others")
          ->type_name("CAPTURES");
  const auto of_measured = [measured](CLI::Option* option) {
    return option->needs(measured)->group("with --measured");
  };
  of_measured(command.add_option("--samples", arguments.samples,
                                 "captures of fewer exposures at the same positions: networks "
                                 "learn them as well, folds are also evaluated on them"))
      ->type_name("CAPTURES");
  of_measured(command.add_option("--schemes", arguments.of_measured.splits.schemes,
                                 "folds: learn all folds but one; few: a few positions of one "
                                 "fold; halves: one half of the volume, along each coordinate and "
                                 "each way"))
      ->check(CLI::IsMember({"folds", "few", "halves"}))
      ->delimiter(',');
  of_measured(command.add_option("--folds", arguments.of_measured.splits.folds,
                                 "folds, by a hash of the true position"))
      ->check(CLI::Range(2, 1000));
  of_measured(command.add_option("--few", arguments.of_measured.splits.few,
                                 "positions of the scheme `few`"))
      ->check(CLI::Range(1, 1000000));
  of_measured(command.add_option("--train", arguments.trained, "networks that are trained"))
      ->check(CLI::IsMember(cnn_architecture_names()))
      ->delimiter(',');
  of_measured(command.add_option("--epochs", arguments.epochs, "most epochs of their training"))
      ->check(CLI::Range(1, 10000000));
  of_measured(command.add_option("--early-stopping", arguments.early_stopping,
                                 "epochs without a smaller loss after which training ends"))
      ->check(number_from_zero());
  of_measured(command.add_option_function<std::vector<std::string>>(
                  "--published",
                  [&arguments](const std::vector<std::string>& texts) {
                    for (const std::string& text : texts) {
                      arguments.published.push_back(published_figure(text));
                    }
                  },
                  "figures from elsewhere to stand on the page, RMSE over all coordinates"))
      ->type_name("NAME=M");
}

int run_measured(const CompareArguments& arguments) {
  if (arguments.scenes.size() != 1) {
    throw Error("SCENE", "found " + std::to_string(arguments.scenes.size()) +
                             " scenes, accepted: one with --measured");
  }
  if (!arguments.networks.empty()) {
    throw Error("--network", "accepted with simulated captures only; see --train");
  }
  const Scene scene = read_scene(arguments.scenes.front());
  MeasuredCaptures measured{read_all_captures({arguments.measured}, scene), {}};
  if (!arguments.samples.empty()) measured.samples = read_all_captures({arguments.samples}, scene);
  MeasuredComparisonOptions options = arguments.of_measured;
  options.seed = arguments.options.seed;
  options.fit.empty_captures = 0;
  options.fit.importance_samples = 2048;  // their number enters the mean's error, docs/cheapspad.md
  options.networks = networks_of(arguments);

  ComparisonReport report;
  report.seed = options.seed;
  report.published = arguments.published;
  report.scenes.push_back(compare_measured(scene, measured, options, [](const std::string& stage) {
    std::fprintf(stderr, "%s\n", stage.c_str());
  }));
  report.scenes.back().file = arguments.scenes.front();
  arguments.out.text("%s\n", comparison_text(report.scenes.back()).c_str());
  const int failures = failures_of(report.scenes.back());
  write_comparison(arguments, report);
  return failures > 0 ? kSomeFailed : kAllWell;
}

}  // namespace blindcorner
