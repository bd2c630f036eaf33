// SPDX-License-Identifier: Apache-2.0
/// `blindcorner cnn dataset SCENE -o DIR`: captures to learn from.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/run_time.h"
#include "blindcorner/forward/scene/orientation.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/capture_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/simulation/dataset.h"
#include "blindcorner/simulation/drive_dataset.h"
#include "blindcorner/simulation/lit_drive.h"
#include "commands/cnn.h"
#include "commands/commands.h"
#include "commands/number_check.h"
#include "commands/output_directory.h"
#include "commands/progress.h"
#include "commands/thread_limit.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kCaptures = "captures.exr";

Json range_json(const Scene& scene, Component component) {
  for (const Unknown& unknown : scene.unknowns) {
    if (unknown.component == component) return {unknown.lower, unknown.upper};
  }
  return nullptr;
}

Json sensor_json(const Transform& T_world_sensor) {
  const Eigen::Vector3d& at = T_world_sensor.translation();
  const Eigen::Vector3d angles = yaw_pitch_roll_of(T_world_sensor.linear()) / kDegree;
  return {{"position_m", {at.x(), at.y(), at.z()}},
          {"yaw_pitch_roll_deg", {angles[0], angles[1], angles[2]}}};
}

/// The fields of the manifest that both kinds of data sets have.
Json manifest(const Scene& scene, const CaptureFile& file, int exposures, std::uint64_t seed,
              const RunTime& run_time) {
  Json json;
  json["format"] = "blindcorner.dataset/1";
  json["scene"] = scene.name;
  json["sensor"] = scene.sensor.name;
  json["captures"] = kCaptures;
  json["count"] = file.captures.size();
  json["exposures"] = exposures;
  json["seed"] = seed;
  json["split_seed"] = seed;
  json["run_time_s"] = run_time_json(run_time);
  return json;
}

void add_plan(const Scene& scene, const DatasetOptions& options, const DatasetPlan& plan,
              Json& json) {
  json["sensor_spread_m"] = plan.sensor_spread;
  json["sensor_yaw_spread_deg"] = options.sensor_yaw_spread / kDegree;
  if (plan.paired) {
    json["random"] = true;
    return;
  }
  json["grid"] = {{"columns", plan.side},
                  {"rows", plan.side},
                  {"x_m", range_json(scene, Component::x)},
                  {"y_m", range_json(scene, Component::y)}};
  json["sensor_poses"] = Json::array();
  for (const Transform& pose : plan.sensors) json["sensor_poses"].push_back(sensor_json(pose));
}

/// An old manifest is removed first and the new one is written last: beside captures of another
/// run, a manifest would be wrong.
void write_dataset(const fs::path& directory, const CaptureFile& file, const Json& manifest) {
  fs::remove(directory / kDatasetManifest);
  write_captures((directory / kCaptures).string(), file);
  write_atomically((directory / kDatasetManifest).string(), manifest.dump(1) + "\n");
  std::printf("%s\n%s\n", (directory / kCaptures).c_str(), (directory / kDatasetManifest).c_str());
}

CaptureFile captures_file(const Scene& scene) {
  CaptureFile file;
  file.bin_width = scene.sensor.bin_width;
  file.sensor = scene.sensor.name;
  file.description = "data set of scene " + scene.name + " to learn from";
  return file;
}

/// Makes a data set from frames of drives by the oracle, as published for the street.
int run_drive_dataset(const CnnDatasetArguments& arguments) {
  const Drive drive = read_lit_drive(arguments.scene, 0);
  const DriveDatasetOptions options{arguments.environments, arguments.options.seed,
                                    arguments.places};
  const std::vector<Trial> drives = plan_drive_dataset(drive, options);
  const Stopwatch stopwatch;
  make_directory(arguments.output);
  CaptureFile file = captures_file(drive.scene);
  Progress progress("drives", drives.size());
  file.captures = record_drives(drive, SimulatedSensor(drive.scene), drives, arguments.places,
                                arguments.threads, [&progress] { progress.advance(); });
  progress.finish();
  Json json = manifest(drive.scene, file, 1, options.seed, stopwatch.since_start());
  json["drive"] = drive.name;
  json["light"] = drive.sensor.light;
  json["environments"] = options.environments;
  json["places"] = options.places;
  write_dataset(arguments.output, file, json);
  return kAllWell;
}

int run_grid_dataset(CnnDatasetArguments arguments) {
  DatasetOptions& options = arguments.options;
  if (arguments.sensor_spread >= 0) options.sensor_spread = arguments.sensor_spread;
  options.sensor_yaw_spread = arguments.sensor_yaw_spread_deg * kDegree;
  const Scene scene = read_scene(arguments.scene);
  const DatasetPlan plan = plan_dataset(scene, options);
  const Stopwatch stopwatch;
  make_directory(arguments.output);
  CaptureFile file = captures_file(scene);
  Progress progress("captures", plan.captures());
  file.captures = render_dataset(scene, plan, options, [&progress] { progress.advance(); });
  progress.finish();
  Json json = manifest(scene, file, options.exposures, options.seed, stopwatch.since_start());
  add_plan(scene, options, plan, json);
  write_dataset(arguments.output, file, json);
  return kAllWell;
}

}  // namespace

int run_cnn_dataset(const CnnDatasetArguments& arguments) {
  const ThreadLimit threads(arguments.threads);
  return arguments.environments > 0 ? run_drive_dataset(arguments) : run_grid_dataset(arguments);
}

void add_cnn_dataset(CLI::App& cnn, int& exit_code) {
  CLI::App& command = *cnn.add_subcommand(
      "dataset",
      "captures of the object on a grid of places from several poses of the sensor, with the noise "
      "of a drive, or the frames of drives; writes DIR/captures.exr and DIR/dataset.json");
  const auto arguments = std::make_shared<CnnDatasetArguments>();
  command.add_option("SCENE", arguments->scene, "scene file; with --environments a drive file")
      ->required();
  command
      .add_option("-o,--output", arguments->output, "directory for the data set; made if missing")
      ->required()
      ->type_name("DIR");
  command
      .add_option("--objects", arguments->options.objects,
                  "places of the object, a square number: a grid over the ranges of x and y; other "
                  "unknowns are drawn from the prior")
      ->check(CLI::Range(1, 1000000));
  command
      .add_option(
          "--random", arguments->options.random,
          "so many captures instead of the grid, each with a place of the object and a pose "
          "of the sensor of its own")
      ->check(CLI::Range(1, 10000000));
  command
      .add_option("--sensors", arguments->options.sensors,
                  "poses of the sensor: the scene's own and others drawn around it")
      ->check(CLI::Range(1, 100000));
  command
      .add_option("--sensor-spread-m", arguments->sensor_spread,
                  "half the range of the sensor's x and of its y; default: 5 % of the distance to "
                  "the surface that it looks at")
      ->check(number_from_zero());
  command
      .add_option("--sensor-yaw-spread-deg", arguments->sensor_yaw_spread_deg,
                  "half the range of the sensor's yaw")
      ->check(CLI::Range(0.0, 180.0));
  command
      .add_option("--exposures", arguments->options.exposures,
                  "exposures that are averaged in each capture")
      ->check(CLI::Range(1, 1000000));
  command
      .add_option(
          "--environments", arguments->environments,
          "drives by the oracle, whose frames are recorded until the object comes in sight; "
          "instead of the grid (published: 30)")
      ->check(CLI::Range(1, 100000));
  command
      .add_option("--places", arguments->places,
                  "with --environments: captures of each frame, the first of what is there, the "
                  "others of hidden objects elsewhere")
      ->check(CLI::Range(1, 100));
  command.add_option("--seed", arguments->options.seed, "of poses and photons");
  command.add_option("--threads", arguments->threads, "0: one per processor")
      ->check(CLI::Range(0, 1024));
  command.callback([arguments, &exit_code] { exit_code = run_cnn_dataset(*arguments); });
}

}  // namespace blindcorner
