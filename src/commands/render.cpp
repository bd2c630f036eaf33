// SPDX-License-Identifier: Apache-2.0
/// `blindcorner render SCENE -o CAPTURE`: captures of a scene made by a forward model.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>
#include <random>
#include <set>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/hints.h"
#include "blindcorner/io/capture_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/simulation/rendering.h"
#include "blindcorner/simulation/sensor_path.h"
#include "blindcorner/simulation/synthetic.h"
#include "commands/capture_inputs.h"
#include "commands/commands.h"
#include "commands/interrupt.h"
#include "commands/number_check.h"
#include "commands/pose_text.h"
#include "commands/progress.h"

namespace blindcorner {
namespace {

struct RenderArguments {
  std::string scene;
  std::string output;
  std::vector<std::string> poses;
  std::vector<std::string> sensor_poses;
  std::string sensor_path;
  int frames = 0;
  int random = 0;
  RenderOptions options;
};

/// For each capture a list of placements, one for each object.
std::vector<std::vector<Placement>> wanted_placements(const RenderArguments& arguments,
                                                      const Scene& scene) {
  std::vector<std::vector<Placement>> placements;
  for (const std::string& text : arguments.poses) placements.push_back(parse_pose(scene, text));
  std::mt19937_64 random(arguments.options.seed);
  for (int i = 0; i < arguments.random; ++i) {
    placements.push_back(placements_at(scene, draw_pose(scene, random)));
  }
  if (placements.empty()) placements.push_back(stated_placements(scene));
  return placements;
}

/// Poses of the sensor: one, or one for each capture.
std::vector<Transform> wanted_sensor_poses(const RenderArguments& arguments, const Scene& scene) {
  std::vector<Transform> poses;
  if (!arguments.sensor_path.empty()) poses = read_sensor_poses(scene, arguments.sensor_path);
  for (const std::string& text : arguments.sensor_poses) {
    poses.push_back(parse_sensor_pose(scene, "--sensor-pose", text));
  }
  if (poses.empty()) poses.push_back(scene.T_world_sensor);
  return arguments.frames > 0 ? sensor_path(poses, arguments.frames) : poses;
}

/// Says on the standard error stream what is odd about the poses, a line each.
void tell_placement_hints(const std::vector<Scene>& seen,
                          const std::vector<std::vector<Placement>>& placements) {
  std::set<std::string> told;
  const std::size_t count = std::max(seen.size(), placements.size());
  for (std::size_t i = 0; i < count; ++i) {
    const Scene& scene = seen[seen.size() == 1 ? 0 : i];
    const auto& objects = placements[placements.size() == 1 ? 0 : i];
    for (const std::string& hint : placement_hints(scene, sensor_placement(scene), objects)) {
      if (!told.insert(hint).second) continue;
      const std::string which = count > 1 ? "capture " + std::to_string(i) + ": " : "";
      std::fprintf(stderr, "blindcorner: hint: %s%s\n", which.c_str(), hint.c_str());
    }
  }
}

int run_render(const RenderArguments& arguments) {
  require_exr(arguments.output);
  const Scene scene = read_scene(arguments.scene);
  const auto placements = wanted_placements(arguments, scene);
  const std::vector<Transform> sensors = wanted_sensor_poses(arguments, scene);
  const std::size_t count = capture_count(placements.size(), sensors.size());
  std::vector<Scene> seen;  // [sensors]
  for (const Transform& pose : sensors) seen.push_back(seen_from(scene, pose));
  if (!arguments.options.empty) tell_placement_hints(seen, placements);
  std::optional<Progress> progress;
  std::optional<StageProgress> stages;
  if (count > 1) {
    progress.emplace("captures", count);
  } else {
    stages.emplace("rendering by the " + arguments.options.model + " model");
  }
  std::optional<Interruptible> interruptible;  // a single capture has nothing to keep
  if (count > 1) interruptible.emplace();
  RenderHooks hooks;
  hooks.stop = [] { return Interruptible::asked(); };
  hooks.advance = [&] {
    if (progress) progress->advance();
  };
  CaptureFile file = render_captures(scene, placements, sensors, arguments.options, hooks);
  for (Capture& capture : file.captures) capture.source = arguments.output;
  progress.reset();
  stages.reset();
  std::erase_if(file.captures, [](const Capture& c) { return c.counts.values.empty(); });
  const std::size_t done = file.captures.size();
  if (done > 0) {
    write_captures(arguments.output, file);
    std::printf("%s: %zu capture%s of %d x %d zones, %d bins\n", arguments.output.c_str(), done,
                done == 1 ? "" : "s", scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
  }
  if (done == count) return kAllWell;
  tell_interrupted(done, count, "captures", done > 0 ? "the file holds these" : "");
  return kSomeFailed;
}

}  // namespace

void add_render_command(CLI::App& app, int& exit_code) {
  CLI::App& command = *app.add_subcommand("render", "make captures of a scene");
  const auto arguments = std::make_shared<RenderArguments>();
  command.add_option("SCENE", arguments->scene, "scene file")->required();
  command.add_option("-o,--output", arguments->output, "capture file to write")->required();
  command.add_option("--pose", arguments->poses,
                     "pose of the object, such as x_m=0.3,yaw_deg=20; may be repeated; components "
                     "left out keep the scene's values");
  command.add_option("--random", arguments->random, "this many poses drawn from the prior")
      ->check(number_from_zero());
  command.add_option("--sensor-pose", arguments->sensor_poses,
                     "pose of the sensor, such as x_m=1,y_m=0.2,z_m=1,yaw_deg=10,pitch_deg=5,"
                     "roll_deg=0; may be repeated, one for each capture or for each pose of the "
                     "object; components left out keep the scene's values");
  command
      .add_option("--sensor-path", arguments->sensor_path,
                  "table (.csv) of such poses, a row each, whose header names the components")
      ->type_name("FILE");
  command
      .add_option("--frames", arguments->frames,
                  "this many sensor poses along the way through the given ones")
      ->check(positive_number());
  command.add_option("--model", arguments->options.model, "reference or fast")
      ->check(CLI::IsMember({"reference", "fast"}))
      ->capture_default_str();
  command.add_flag(
      "--noiseless", arguments->options.noiseless,
      "expected values: S plus static return times gain; no ambient light, no measured background");
  command.add_flag("--empty", arguments->options.empty, "no hidden object");
  command
      .add_option("--photons", arguments->options.photons,
                  "choose the exposure so that the third bounce gives this many photons, over an "
                  "equal background in its time gate")
      ->check(number_in({.lower = 0, .upper = 1e18, .above_lower = true}, "PHOTONS"));
  command.add_option("--tolerance", arguments->options.fast.tolerance, "of the fast model")
      ->capture_default_str();
  command
      .add_option("--reference-sampling", arguments->options.sampling,
                  "cells of the reference renderer along each axis, in units of the usual ones; "
                  "default: 1, above 100,000 photons 2")
      ->check(number_in({.lower = 0.1, .upper = 10}, "SCALE"));
  const CLI::Validator divisions = number_in({.lower = 1, .upper = 1000}, "INT");
  command
      .add_option("--zone-divisions", arguments->options.zone_divisions,
                  "of the reference renderer")
      ->check(divisions);
  command
      .add_option("--field-divisions", arguments->options.field_divisions,
                  "of the reference renderer")
      ->check(divisions);
  command.add_option("--seed", arguments->options.seed, "of poses and photons")
      ->capture_default_str();
  command.callback([arguments, &exit_code] { exit_code = run_render(*arguments); });
}

}  // namespace blindcorner
