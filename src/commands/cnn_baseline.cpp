// SPDX-License-Identifier: Apache-2.0
/// `blindcorner cnn baseline SCENE|DRIVE -o DIR`: data, training and errors by one command.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/scene_file.h"
#include "commands/cnn.h"
#include "commands/commands.h"
#include "commands/notice.h"
#include "io/file_bytes.h"
#include "io/file_kind.h"
#include "io/json_reader.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;
using Json = JsonReader::Json;

/// The published data are 400 places by 5 poses of the sensor, or 30 drives. The ensemble (wide)
/// learns ten times as many captures.
constexpr int kWideCaptures = 20000;
constexpr int kEnvironments = 30;
constexpr int kWidePlaces = 10;  ///< of the hidden object in each frame

struct BaselineArguments {
  std::string source;  ///< scene file or drive file
  std::string output;
  std::string network = "published";
  std::optional<int> epochs;
  std::optional<int> captures;  ///< of a scene; drawn at random
  std::optional<int> environments;
  std::optional<int> places;  ///< of a drive file
  std::uint64_t seed = 1;

  bool wide() const { return network == "wide"; }
  std::string directory(const std::string& name) const {
    return (fs::path(output) / name).string();
  }
};

/// Path of the scene that a drive file names. Empty for a scene file.
std::string scene_of_drive(const std::string& path) {
  const Json json = JsonReader::parse(read_bytes(path), path);
  if (kind_of(json) != FileKind::drive) return {};
  return (fs::path(path).parent_path() / JsonReader(json, path).at("scene").text()).string();
}

/// The data set that the arguments ask for.
CnnDatasetArguments data_of(const BaselineArguments& arguments, bool drive,
                            const std::string& directory) {
  CnnDatasetArguments data;
  data.scene = arguments.source;
  data.output = directory;
  data.options.seed = arguments.seed;
  if (drive) {
    data.environments = arguments.environments.value_or(kEnvironments);
    data.places = arguments.places.value_or(arguments.wide() ? kWidePlaces : 1);
  } else {
    data.options.random = arguments.captures.value_or(arguments.wide() ? kWideCaptures : 0);
  }
  return data;
}

/// Throws Error naming the file if the data that exist are not those that are asked for.
void check_data(const std::string& path, const std::string& scene,
                const CnnDatasetArguments& wanted) {
  const Json found = JsonReader::parse(read_bytes(path), path);
  // The scene is compared first: a wrong scene says more about the data than their number does.
  std::vector<std::pair<std::string, Json>> fields{{"scene", read_scene(scene).name},
                                                   {"seed", wanted.options.seed}};
  if (wanted.environments > 0) {
    fields.emplace_back("environments", wanted.environments);
    fields.emplace_back("places", wanted.places);
  } else {
    const DatasetOptions& o = wanted.options;
    fields.emplace_back("count", o.random > 0 ? o.random : o.objects * o.sensors);
  }
  for (const auto& [name, value] : fields) {
    const Json there = found.is_object() ? found.value(name, Json()) : found;
    if (there == value) continue;
    throw Error(path + ": " + name,
                "found " + there.dump() + ", accepted: " + value.dump() + ", or another directory");
  }
}

/// Makes the data unless they exist.
void provide_data(const std::string& scene, const CnnDatasetArguments& wanted) {
  const std::string manifest = (fs::path(wanted.output) / kDatasetManifest).string();
  if (fs::exists(manifest)) return check_data(manifest, scene, wanted);
  run_cnn_dataset(wanted);
}

int run_baseline(const BaselineArguments& arguments) {
  if (!CnnBaseline::available()) CnnBaseline::load(arguments.source);  // says how to get it
  const std::string named = scene_of_drive(arguments.source);
  const std::string scene = named.empty() ? arguments.source : named;
  const std::string data = arguments.directory(arguments.wide() ? "data_wide" : "data");
  tell_begun("step 1 of 3: captures to learn from, in " + data);
  provide_data(scene, data_of(arguments, !named.empty(), data));
  CnnTrainArguments train;
  train.scene = scene;
  train.captures = {data};
  train.output = arguments.directory(arguments.wide() ? "net_wide" : "net");
  train.network = arguments.network;
  train.epochs = arguments.epochs;
  train.resume = true;
  train.options.seed = arguments.seed;
  tell_begun("step 2 of 3: training, in " + train.output);
  const int trained = run_cnn_train(train);
  if (trained != kAllWell) return trained;
  CnnEvaluateArguments evaluate;
  evaluate.scene = scene;
  evaluate.weights = train.file("weights.pt");
  evaluate.captures = {data};
  evaluate.output = arguments.directory(arguments.wide() ? "errors_wide" : "errors");
  evaluate.held_back = true;
  tell_begun("step 3 of 3: errors on the captures held back, in " + evaluate.output);
  return run_cnn_evaluate(evaluate);
}

}  // namespace

void add_cnn_baseline(CLI::App& cnn, int& exit_code) {
  CLI::App& command = *cnn.add_subcommand(
      "baseline",
      "data, training and errors by one command, with the published numbers; goes on where it was "
      "interrupted; writes DIR/data, DIR/net/weights.pt and DIR/errors (of wide data_wide and so "
      "on)");
  const auto arguments = std::make_shared<BaselineArguments>();
  command.add_option("SCENE", arguments->source, "scene file or drive file")->required();
  command
      .add_option("-o,--output", arguments->output, "directory for the results; made if missing")
      ->required()
      ->type_name("DIR");
  command
      .add_option("--network", arguments->network,
                  "published; or wide: an ensemble of five wider ones that states a covariance, "
                  "trained on ten times the data")
      ->check(CLI::IsMember(cnn_architecture_names()));
  command.add_option("--epochs", arguments->epochs, "as of cnn train")
      ->check(CLI::Range(1, 10000000));
  command
      .add_option(
          "--captures", arguments->captures,
          "of a scene: so many, drawn at random; default: the published grid, of wide 20000")
      ->check(CLI::Range(3, 10000000));
  command.add_option("--environments", arguments->environments, "of a drive file; default: 30")
      ->check(CLI::Range(1, 100000));
  command
      .add_option("--places", arguments->places,
                  "of a drive file: captures of each frame, the first of what is there, the others "
                  "of hidden objects elsewhere; default: 1, of wide 10")
      ->check(CLI::Range(1, 100));
  command.add_option("--seed", arguments->seed, "of data, weights and split");
  command.callback([arguments, &exit_code] { exit_code = run_baseline(*arguments); });
}

}  // namespace blindcorner
