// SPDX-License-Identifier: Apache-2.0
/// `blindcorner benchmark detection`: objects found and false alarms, at every level of light.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/scene_file.h"
#include "commands/benchmark.h"
#include "commands/output_directory.h"
#include "commands/progress.h"
#include "commands/thread_limit.h"
#include "report/detection_page.h"

namespace blindcorner {
namespace {

struct DetectionArguments {
  std::vector<std::string> scenes;
  std::string output = "out/benchmark", light = "reference";
  int threads = 0;
  DetectionOptions options;
};

void write_detection(const DetectionReport& report, const std::string& output) {
  const std::filesystem::path directory(output);
  write_atomically((directory / "detection.csv").string(), detection_csv(report));
  write_atomically((directory / "false_alarms.csv").string(), false_alarms_csv(report));
  write_atomically((directory / "roc.csv").string(), roc_csv(report));
  write_atomically((directory / "detection.json").string(), detection_json(report).dump(1) + "\n");
  write_atomically((directory / "detection.html").string(), detection_page(report));
}

int run_detection(const DetectionArguments& arguments) {
  const ThreadLimit threads(arguments.threads);
  DetectionReport report;
  report.options = arguments.options;
  report.options.light = arguments.light == "sensor" ? TrueLight::sensor : TrueLight::reference;
  report.options.validate();
  std::vector<Scene> scenes;
  for (const std::string& path : arguments.scenes) scenes.push_back(read_scene(path));
  make_directory(arguments.output);
  const DetectionOptions& options = report.options;
  const std::size_t fits =
      options.photons.size() * static_cast<std::size_t>(options.captures + options.empty_captures);
  for (const Scene& scene : scenes) {
    Progress progress(scene.name, fits);
    report.scenes.push_back(study_detection(scene, options, [&] { progress.advance(); }));
  }
  const bool all_hold = judge_detection(report.scenes);
  int failures = 0;
  for (const DetectionScene& scene : report.scenes) {
    std::printf("%s\n", detection_text(scene).c_str());
    for (const DetectionLevel& level : scene.levels) failures += level.failures;
  }
  write_detection(report, arguments.output);
  std::printf("%s\n%s\n",
              (std::filesystem::path(arguments.output) / "detection.html").string().c_str(),
              detection_headline(report).c_str());
  return all_hold && failures == 0 ? kAllWell : kSomeFailed;
}

}  // namespace

void add_detection_benchmark(CLI::App& benchmark, int& exit_code) {
  CLI::App& command = *benchmark.add_subcommand(
      "detection",
      "objects found against false alarms, and whether the stated false-alarm probability is met; "
      "writes DIR/detection.html, .csv and .json; exit code 1: it is not");
  const auto arguments = std::make_shared<DetectionArguments>();
  command.add_option("SCENE", arguments->scenes, "scene files")->required();
  command
      .add_option("-n,--captures", arguments->options.captures,
                  "captures with an object, at each level of light")
      ->check(CLI::Range(1, 10'000'000))
      ->capture_default_str();
  command
      .add_option("--empty", arguments->options.empty_captures,
                  "captures without one, at each level of light")
      ->check(CLI::Range(1, 10'000'000))
      ->capture_default_str();
  command
      .add_option("--calibrated-on", arguments->options.fit.empty_captures,
                  "empty captures that the fit simulates to calibrate itself")
      ->check(CLI::Range(16, 1'000'000))
      ->capture_default_str();
  command.add_option("-o,--output", arguments->output, "directory to write to")
      ->capture_default_str();
  command
      .add_option("--photons", arguments->options.photons,
                  "of the object on average over the search region, a list with commas")
      ->delimiter(',')
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command
      .add_option("--light", arguments->light,
                  "whose light the captures hold: the reference renderer's or the simulated "
                  "sensor's")
      ->check(CLI::IsMember({"reference", "sensor"}))
      ->capture_default_str();
  command
      .add_option("--truth", arguments->options.sampling,
                  "sampling of the captures, in units of the reference renderer's default")
      ->check(CLI::Range(0.1, 10.0))
      ->capture_default_str();
  command.add_option("--seed", arguments->options.seed, "of poses, brightness and photons")
      ->capture_default_str();
  command.add_option("--threads", arguments->threads, "0: one per processor")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  command.callback([arguments, &exit_code] { exit_code = run_detection(*arguments); });
}

}  // namespace blindcorner
