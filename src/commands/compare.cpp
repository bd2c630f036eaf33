// SPDX-License-Identifier: Apache-2.0
/// `blindcorner compare SCENE... -o DIR`: the solver beside other methods, on the same captures.
#include "commands/compare.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/baseline/cnn.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/simulation/comparison.h"
#include "commands/commands.h"
#include "commands/output_directory.h"
#include "commands/progress.h"
#include "commands/thread_limit.h"
#include "forward/support/comma_list.h"
#include "io/file_bytes.h"
#include "io/json_reader.h"
#include "report/comparison_page.h"
#include "report/formatted.h"
#include "report/point_estimates.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;
using Json = JsonReader::Json;

/// The condition that also has pictures: places that no method has seen, with nothing else changed.
constexpr const char* kDrawn = "positions between the grid";

struct Network {
  std::string path;
  CnnBaseline cnn;
};

/// The summary of the training beside the weights. Null: there is none, or it is of another
/// training.
Json training_summary(const std::string& weights, const CnnTrainingRecord& training) {
  const std::string summary = (fs::path(weights).parent_path() / "training.json").string();
  if (!fs::exists(summary)) return nullptr;
  auto json = JsonReader::parse(read_bytes(summary), summary);
  const auto is = [&](const char* field, int value) {
    return json.contains(field) && json[field] == value;
  };
  if (!is("epoch_of_weights", training.epoch) || !is("captures", training.captures)) return nullptr;
  return json;
}

/// "trained in 371 s, 370 s of processor time".
std::string time_text(const Json& summary, const char* field, const char* what) {
  const Json time = summary.is_object() ? summary.value(field, Json()) : Json();
  const auto is_number = [&](const char* name) {
    return time.is_object() && time.contains(name) && time[name].is_number();
  };
  if (!is_number("wall") || !is_number("processor")) return formatted("%s in unknown time", what);
  return formatted("%s in %.0f s, %.0f s of processor time", what, time["wall"].get<double>(),
                   time["processor"].get<double>());
}

std::string training_text(const Network& network) {
  const CnnTrainingRecord& training = network.cnn.description().training;
  const Json summary = training_summary(network.path, training);
  return formatted("%s: %d captures (", network.path.c_str(), training.captures) +
         time_text(summary, "data_run_time_s", "made") +
         formatted("), of which %g %% held back; weights after epoch %d, ",
                   100 * training.validation_share, training.epoch) +
         time_text(summary, "run_time_s", "trained");
}

/// "wide network", with a number if several networks of one architecture were trained for one
/// scene.
std::string name_of(const std::vector<Network>& networks, std::size_t which) {
  const auto same = [&](const Network& other) {
    const CnnDescription &a = networks[which].cnn.description(), &b = other.cnn.description();
    return a.scene == b.scene && a.network == b.network;
  };
  std::string name = cnn_architecture_name(networks[which].cnn.description().network) + " network";
  if (std::ranges::count_if(networks, same) == 1) return name;
  const auto before = networks.begin() + static_cast<std::ptrdiff_t>(which);
  return name + " " + std::to_string(std::count_if(networks.begin(), before, same) + 1);
}

/// The methods for a scene: the untrained ones, and the networks that were trained for it. Throws
/// Error if one of these does not suit it.
std::vector<ComparedMethod> methods_of(const Scene& scene, const std::vector<Network>& networks,
                                       const CompareArguments& arguments) {
  const std::uint64_t seed = arguments.options.seed;
  std::vector<ComparedMethod> methods = untrained_methods(scene, seed);
  for (std::size_t i = 0; i < networks.size(); ++i) {
    const Network& network = networks[i];
    if (network.cnn.description().scene != scene.name) continue;
    network.cnn.check_scene(scene);
    const std::string name = name_of(networks, i);
    methods.push_back(network_method(scene, network.cnn, name, training_text(network), seed));
  }
  return methods;
}

/// Throws Error if a network was trained for none of the scenes.
void check_networks_are_used(const std::vector<Network>& networks,
                             const std::vector<Scene>& scenes) {
  for (const Network& network : networks) {
    const std::string& name = network.cnn.description().scene;
    const bool used =
        std::ranges::any_of(scenes, [&](const Scene& scene) { return scene.name == name; });
    if (used) continue;
    std::string names;
    for (const Scene& scene : scenes) names += (names.empty() ? "" : ", ") + scene.name;
    throw Error(network.path + ": metadata.scene",
                "found " + name + ", accepted with these scenes: " + names);
  }
}

std::vector<ComparisonPicture> pictures(const Scene& scene, const Condition& condition,
                                        const std::vector<ComparedMethod>& methods,
                                        const std::vector<std::vector<MethodAnswer>>& answers) {
  std::vector<ComparisonPicture> all;
  for (std::size_t m = 0; m < methods.size(); ++m) {
    std::vector<PointEstimate> estimates;
    for (std::size_t i = 0; i < condition.captures.size(); ++i) {
      if (!answers[m][i].error.empty()) continue;
      const Capture& capture = condition.captures[i];
      PointEstimate& e = estimates.emplace_back();
      e.index = static_cast<int>(i);
      e.estimate = answers[m][i].pose;
      e.truth.resize(e.estimate.size());
      Eigen::Index k = 0;
      for (const std::string& name : unknown_names(scene)) e.truth[k++] = capture.truth.at(name);
      e.T_world_sensor = capture.T_world_sensor.value_or(scene.T_world_sensor);
    }
    all.push_back({methods[m].name + ", " + condition.name, point_estimates_svg(scene, estimates)});
  }
  return all;
}

SceneComparison compare_scene(const Scene& scene, const std::string& file,
                              const std::vector<Network>& networks,
                              const CompareArguments& arguments,
                              std::vector<ComparisonPicture>& drawn) {
  const ComparisonOptions& options = arguments.options;
  SceneComparison comparison{scene.name, file, unknown_names(scene), {}, {}};
  comparison.methods = methods_of(scene, networks, arguments);
  const std::size_t wanted =
      options.conditions.empty() ? condition_names().size() : options.conditions.size();
  const std::size_t captures = static_cast<std::size_t>(options.captures) * wanted;
  Progress rendering(scene.name + ": captures", captures);
  const std::vector<Condition> conditions =
      render_conditions(scene, options, [&rendering] { rendering.advance(); });
  rendering.finish();
  std::size_t count = 0;
  for (const Condition& c : conditions) count += c.captures.size();
  Progress answering(scene.name + ": answers", count * comparison.methods.size());
  for (const Condition& condition : conditions) {
    const auto answers =
        answer_all(comparison.methods, condition.captures, [&answering] { answering.advance(); });
    comparison.conditions.push_back(
        compare(scene, condition, comparison.methods, answers, options.seed));
    if (condition.name == kDrawn) drawn = pictures(scene, condition, comparison.methods, answers);
  }
  answering.finish();
  return comparison;
}

}  // namespace

int failures_of(const SceneComparison& comparison) {
  int failures = 0;
  for (const ConditionFigures& c : comparison.conditions) {
    for (const MethodFigures& m : c.methods) {
      failures += m.failures;
      if (m.failures == 0) continue;
      std::fprintf(stderr, "blindcorner: %s, %s, %s: %d captures failed: %s\n",
                   comparison.scene.c_str(), c.condition.name.c_str(), m.method.c_str(), m.failures,
                   m.first_error.c_str());
    }
  }
  return failures;
}

void write_comparison(const CompareArguments& arguments, const ComparisonReport& report) {
  make_directory(arguments.output);
  const fs::path directory = arguments.output;
  write_atomically((directory / "comparison.csv").string(), comparison_csv(report.scenes));
  write_atomically(
      (directory / "comparison.json").string(),
      comparison_json(report).dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
  write_atomically((directory / "comparison.html").string(), comparison_page(report));
  arguments.out.file((directory / "comparison.json").string());
  arguments.out.text("%s\n", (directory / "comparison.html").c_str());
}

namespace {

int run_simulated(CompareArguments& arguments) {
  for (std::string& name : arguments.options.conditions) name = condition_named(name);
  arguments.options.validate();
  std::vector<Scene> scenes;
  for (const std::string& path : arguments.scenes) scenes.push_back(read_scene(path));
  std::vector<Network> networks;
  for (const std::string& path : arguments.networks) {
    networks.push_back({path, CnnBaseline::load(path)});
  }
  check_networks_are_used(networks, scenes);
  // Mistakes in any scene are found here, before the comparison of another one takes minutes.
  for (const Scene& scene : scenes) {
    methods_of(scene, networks, arguments);
    plan_dataset(scene, arguments.options.dataset);
  }
  ComparisonReport report;
  report.simulated = arguments.options;
  report.seed = arguments.options.seed;
  report.published = arguments.published;
  int failures = 0;
  for (std::size_t s = 0; s < scenes.size(); ++s) {
    report.pictures.emplace_back();
    report.scenes.push_back(
        compare_scene(scenes[s], arguments.scenes[s], networks, arguments, report.pictures.back()));
    arguments.out.text("%s\n", comparison_text(report.scenes.back()).c_str());
    failures += failures_of(report.scenes.back());
  }
  write_comparison(arguments, report);
  return failures > 0 ? kSomeFailed : kAllWell;
}

void add_dataset_options(CLI::App& command, DatasetOptions& options) {
  command
      .add_option("--objects", options.objects,
                  "of the data set that networks learnt: places of the object, a square number")
      ->check(CLI::Range(1, 1000000));
  command.add_option("--sensors", options.sensors, "of that data set: poses of the sensor")
      ->check(CLI::Range(1, 100000));
  command
      .add_option("--exposures", options.exposures,
                  "exposures that are averaged in each capture, there and here")
      ->check(CLI::Range(1, 1000000));
  command.add_option("--dataset-seed", options.seed, "of that data set");
}

}  // namespace

void add_compare_command(CLI::App& app, int& exit_code) {
  CLI::App& command = *app.add_subcommand(
      "compare",
      "solver, back-projection, multilateration and networks on the same captures, as trained and "
      "changed; writes DIR/comparison.html, comparison.csv and comparison.json");
  const auto arguments = std::make_shared<CompareArguments>();
  command.add_option("SCENE", arguments->scenes, "scene files")->required();
  command
      .add_option("-o,--output", arguments->output, "directory for the results; made if missing")
      ->required()
      ->type_name("DIR");
  command.add_option("--network", arguments->networks,
                     "weights.pt of cnn train, each for one of the scenes");
  command.add_option("-n,--captures", arguments->options.captures, "captures of each condition")
      ->check(CLI::Range(2, 1000000));
  command
      .add_option("--conditions", arguments->options.conditions,
                  "names of conditions or how they begin, a list with commas; default: all, "
                  "which are " +
                      comma_list(condition_names()))
      ->delimiter(',');
  add_dataset_options(command, arguments->options.dataset);
  command.add_option("--seed", arguments->options.seed,
                     "of places, sensor poses and photons of the comparison");
  arguments->out.add_option(command, "comparison.json");
  command.add_option("--threads", arguments->threads, "0: one per processor")
      ->check(CLI::Range(0, 1024));
  add_measured_options(command, *arguments);
  command.callback([arguments, &exit_code] {
    const ThreadLimit threads(arguments->threads);
    exit_code = arguments->measured.empty() ? run_simulated(*arguments) : run_measured(*arguments);
  });
}

}  // namespace blindcorner
