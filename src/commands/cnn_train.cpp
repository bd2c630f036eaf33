// SPDX-License-Identifier: Apache-2.0
/// `blindcorner cnn train SCENE CAPTURES... -o DIR`.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/baseline/cnn_training.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/scene_file.h"
#include "commands/capture_inputs.h"
#include "commands/cnn.h"
#include "commands/commands.h"
#include "commands/number_check.h"
#include "commands/output_directory.h"
#include "commands/progress.h"
#include "io/file_bytes.h"
#include "io/json_reader.h"
#include "report/cnn_page.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kCheckpointFile = "checkpoint.pt";

/// What the manifest of a data set says of its split, and of the time that the data took to make.
struct Manifest {
  std::optional<std::uint64_t> split_seed;
  Json run_time;  ///< null where it does not say
};

/// The manifest of the data set that `captures` names. Empty: there is none.
Manifest manifest_of(const std::vector<std::string>& captures) {
  if (captures.size() != 1) return {};
  const std::string path = (fs::path(captures.front()) / kDatasetManifest).string();
  if (!fs::exists(path)) return {};
  const Json json = JsonReader::parse(read_bytes(path), path);
  try {
    return {json.at("split_seed").get<std::uint64_t>(), json.value("run_time_s", Json())};
  } catch (const nlohmann::json::exception& error) {
    throw Error(path, one_line(error.what()));
  }
}

std::vector<PointEstimate> estimate_held_back(const Scene& scene,
                                              const std::vector<Capture>& captures,
                                              const CnnBaseline& cnn) {
  std::vector<PointEstimate> estimates;
  for (const Capture& capture : held_back_captures(captures, cnn)) {
    estimates.push_back(cnn_estimate(scene, capture, cnn));
  }
  return estimates;
}

std::string summary_text(const Scene& scene, const CnnTrainArguments& arguments,
                         const CnnTrainingResult& result, std::size_t captures,
                         const Json& data_run_time, const std::vector<PointEstimate>& held_back) {
  const CnnTrainingOptions& options = arguments.options;
  Json json;
  json["format"] = "blindcorner.training/1";
  json["scene"] = scene.name;
  json["captures"] = captures;
  json["network"] = cnn_architecture_name(options.network);
  json["options"] = {{"epochs", options.epochs},
                     {"batch", options.batch},
                     {"learning_rate", options.learning_rate},
                     {"early_stopping", options.early_stopping},
                     {"standardise", options.standardise},
                     {"input_bound", options.input_bound},
                     {"validation_share", options.validation_share},
                     {"seed", options.seed},
                     {"split_seed", options.split_seed}};
  json["epochs"] = result.history.size();
  json["epoch_of_weights"] = result.epoch;
  json["run_time_s"] = run_time_json(result.run_time);
  json["data_run_time_s"] = data_run_time;
  json["validation"] = Json::object();
  if (!held_back.empty()) {
    json["validation"]["errors"] = point_errors_json(point_errors(scene, held_back));
  }
  json["validation"]["captures"] = Json::array();
  for (const PointEstimate& e : held_back) {
    json["validation"]["captures"].push_back({{"source", e.source}, {"index", e.index}});
  }
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

/// Trains, and writes checkpoints from which an interrupted training can go on.
CnnTrainingResult train(const CnnTrainArguments& arguments, const Scene& scene,
                        const std::vector<Capture>& captures) {
  const std::string checkpoint_path = arguments.file(kCheckpointFile);
  std::string checkpoint;
  if (arguments.resume && fs::exists(checkpoint_path)) checkpoint = read_bytes(checkpoint_path);
  const auto total = static_cast<std::size_t>(arguments.options.epochs);
  Progress progress("epochs", total);
  int epochs = 0;
  CnnTrainingCallbacks callbacks;
  callbacks.epoch = [&](int epoch, const CnnEpoch&, const std::function<std::string()>& make) {
    progress.advance(epochs == 0 ? static_cast<std::size_t>(epoch) : 1);
    ++epochs;
    if (epoch % arguments.checkpoint_every != 0 && epoch != arguments.options.epochs) return;
    if (epochs <= arguments.checkpoint_every) make_directory(arguments.output);
    write_atomically(checkpoint_path, make());
  };
  return train_cnn(scene, captures, arguments.options, callbacks, checkpoint);
}

/// Sets the options to the network's own defaults, except for what the command line states.
void apply_stated(CnnTrainArguments& arguments) {
  const CnnTrainingOptions stated = arguments.options;
  CnnTrainingOptions& options = arguments.options;
  options = CnnTrainingOptions::of(parse_cnn_architecture(arguments.network, "--network"));
  options.validation_share = stated.validation_share;
  options.standardise = stated.standardise;
  options.input_bound = stated.input_bound;
  options.seed = stated.seed;
  options.epochs = arguments.epochs.value_or(options.epochs);
  options.batch = arguments.batch.value_or(options.batch);
  options.learning_rate = arguments.learning_rate.value_or(options.learning_rate);
  options.early_stopping =
      arguments.early_stopping.value_or(options.validation_share > 0 ? options.early_stopping : 0);
}

}  // namespace

int run_cnn_train(CnnTrainArguments arguments) {
  const Scene scene = read_scene(arguments.scene);
  apply_stated(arguments);
  const Manifest manifest = manifest_of(arguments.captures);
  arguments.options.split_seed =
      arguments.split_seed.value_or(manifest.split_seed.value_or(arguments.options.seed));
  arguments.options.validate();
  const std::vector<Capture> captures = read_all_captures(arguments.captures, scene);
  const CnnTrainingResult result = train(arguments, scene, captures);
  const CnnBaseline cnn = CnnBaseline::parse(result.weights, "weights");
  const std::vector<PointEstimate> held_back = estimate_held_back(scene, captures, cnn);
  make_directory(arguments.output);
  write_atomically(arguments.file("weights.pt"), result.weights);
  write_atomically(arguments.file("training.csv"), training_csv(result.history));
  write_atomically(
      arguments.file("training.json"),
      summary_text(scene, arguments, result, captures.size(), manifest.run_time, held_back));
  write_atomically(arguments.file("training.html"),
                   training_page(scene, arguments.options, result, held_back));
  arguments.out.file(arguments.file("training.json"));
  arguments.out.text(
      "%zu captures, %zu epochs, %.1f s (%.1f s of processor time); weights of epoch %d\n",
      captures.size(), result.history.size(), result.run_time.wall, result.run_time.processor,
      result.epoch);
  if (!held_back.empty()) {
    arguments.out.text("errors on the %zu captures held back, m and rad:\n%s", held_back.size(),
                       point_errors_text(point_errors(scene, held_back)).c_str());
  }
  arguments.out.text("%s\n%s\n", arguments.file("weights.pt").c_str(),
                     arguments.file("training.html").c_str());
  return kAllWell;
}

void add_cnn_train(CLI::App& cnn, int& exit_code) {
  CLI::App& command =
      *cnn.add_subcommand("train",
                          "train a network on captures with their truth; writes DIR/weights.pt, "
                          "training.csv, training.json and training.html");
  const auto arguments = std::make_shared<CnnTrainArguments>();
  command.add_option("SCENE", arguments->scene, "scene file")->required();
  command
      .add_option("CAPTURES", arguments->captures,
                  "capture files or directories of them, such as one of cnn dataset")
      ->required();
  command
      .add_option("-o,--output", arguments->output, "directory for the results; made if missing")
      ->required()
      ->type_name("DIR");
  command
      .add_option("--network", arguments->network,
                  "published; or wide: an ensemble of five wider ones that states a covariance")
      ->check(CLI::IsMember(cnn_architecture_names()));
  command
      .add_option("--epochs", arguments->epochs,
                  "passes over the captures; default: 2000, of wide at most 60")
      ->check(CLI::Range(1, 10000000));
  command.add_option("--batch", arguments->batch, "captures of a step; default: 16, of wide 64")
      ->check(CLI::Range(2, 1000000));
  command.add_option("--learning-rate", arguments->learning_rate, "of Adam; default: 0.001")
      ->check(positive_number());
  command
      .add_option("--early-stopping", arguments->early_stopping,
                  "stop after so many epochs without a smaller loss on the captures held back, and "
                  "keep the weights of the smallest; 0: run all epochs and keep the last; default: "
                  "0, of wide 10")
      ->check(number_from_zero());
  command
      .add_option("--validation-share", arguments->options.validation_share,
                  "share of the captures that is held back")
      ->check(CLI::Range(0.0, 0.99));
  command.add_flag("--standardise,!--no-standardise", arguments->options.standardise,
                   "each bin enters as its difference from the mean over the standard deviation "
                   "(default), or as published");
  command
      .add_option("--input-bound", arguments->options.input_bound,
                  "standard deviations at which standardised bins and sensor poses are clipped; 0: "
                  "they are not")
      ->check(number_from_zero());
  command.add_option("--seed", arguments->options.seed, "of weights, order and dropout");
  command.add_option("--split-seed", arguments->split_seed,
                     "of which captures are held back; default: what the data set says, else "
                     "--seed");
  command.add_flag("--resume", arguments->resume,
                   "go on from DIR/checkpoint.pt, which an interrupted training left behind, to "
                   "the same weights");
  command
      .add_option("--checkpoint-every", arguments->checkpoint_every, "epochs between checkpoints")
      ->check(CLI::Range(1, 1000000));
  arguments->out.add_option(command, "training.json");
  command.callback([arguments, &exit_code] { exit_code = run_cnn_train(*arguments); });
}

}  // namespace blindcorner
