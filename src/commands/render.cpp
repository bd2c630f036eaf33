// SPDX-License-Identifier: Apache-2.0
/// `blindcorner render SCENE -o CAPTURE`: captures of a scene made by a forward model.
#include <tbb/parallel_for.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>
#include <random>
#include <set>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/inverse/hints.h"
#include "blindcorner/io/capture_file.h"
#include "blindcorner/io/scene_file.h"
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
  std::string model = "reference";
  bool noiseless = false;
  bool empty = false;
  std::uint64_t seed = 1;
  int random = 0;
  double photons = 0;
  FastModelOptions fast;
  std::optional<double> sampling;
  std::optional<int> zone_divisions, field_divisions;
};

/// Photons from which on the reference renderer's own error, .2 to .5 % of the light where
/// something stands in its way (tmf8828_wall), is a third of their noise.
constexpr double kBright = 1e5;
/// Sampling that leaves a fifth of that, for ten times the time.
constexpr double kBrightSampling = 2;

ReferenceOptions reference_options(const RenderArguments& arguments) {
  const double usual = arguments.photons > kBright ? kBrightSampling : 1;
  ReferenceOptions options = reference_sampling(arguments.sampling.value_or(usual));
  options.zone_divisions = arguments.zone_divisions.value_or(options.zone_divisions);
  options.field_divisions = arguments.field_divisions.value_or(options.field_divisions);
  return options;
}

/// The scene with every component free, so that a pose may set any of them.
Scene fully_free(const Scene& scene) {
  Scene free = scene;
  free.unknowns.clear();
  for (int object = 0; object < object_count(scene); ++object) {
    for (const Component component :
         {Component::x, Component::y, Component::z, Component::yaw, Component::size}) {
      const double value = hidden_object(scene, object).placement.get(component);
      Unknown unknown{component, value, value, {}, object};
      for (const Unknown& known : scene.unknowns) {
        if (known.component == component && known.object == object) unknown = known;
      }
      free.unknowns.push_back(unknown);
    }
  }
  return free;
}

/// One list of placements, a placement for each object, per capture.
std::vector<std::vector<Placement>> wanted_placements(const RenderArguments& arguments,
                                                      const Scene& scene) {
  std::vector<std::vector<Placement>> placements;
  for (const std::string& text : arguments.poses) placements.push_back(parse_pose(scene, text));
  std::mt19937_64 random(arguments.seed);
  for (int i = 0; i < arguments.random; ++i) {
    placements.push_back(placements_at(scene, draw_pose(scene, random)));
  }
  if (placements.empty()) placements.push_back(stated_placements(scene));
  return placements;
}

/// Where the sensor stands, one pose or one for each capture.
std::vector<Transform> wanted_sensor_poses(const RenderArguments& arguments, const Scene& scene) {
  std::vector<Transform> poses;
  if (!arguments.sensor_path.empty()) poses = read_sensor_poses(scene, arguments.sensor_path);
  for (const std::string& text : arguments.sensor_poses) {
    poses.push_back(parse_sensor_pose(scene, "--sensor-pose", text));
  }
  if (poses.empty()) poses.push_back(scene.T_world_sensor);
  return arguments.frames > 0 ? sensor_path(poses, arguments.frames) : poses;
}

Capture render_one(const RenderArguments& arguments, const Scene& scene, const Scene& free,
                   const ForwardModel& model, const std::vector<Placement>& placements,
                   std::uint64_t seed) {
  const PoseVector pose = pose_of(placements, free.unknowns);
  Capture capture;
  if (arguments.noiseless || arguments.empty) {
    const HistogramCube light =
        arguments.empty ? HistogramCube(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins)
                        : model.three_bounce(pose);
    // Without noise: S plus static, in W/m^2 per W/sr, when gains and amplitude are one.
    const LinearValues linear{scene.linear.fixed_amplitude,
                              arguments.noiseless ? 0.0 : scene.linear.fixed_ambient,
                              scene.linear.fixed_direct, arguments.noiseless ? 0.0 : 1.0};
    const HistogramCube known =
        arguments.empty ? model.static_background() : model.shadowed_background(pose);
    capture.counts = expected_counts(scene, light, known, linear);
    if (arguments.noiseless) {
      saturate(scene.sensor, capture.counts);
    } else {
      capture.counts = draw_counts(scene, capture.counts, 1.0, seed);
    }
  } else {
    LightBudget budget;
    if (arguments.photons > 0) budget.third_bounce_photons = arguments.photons;
    capture = make_capture(free, model, pose, budget, seed);
  }
  capture.T_world_sensor = scene.T_world_sensor;
  capture.truth = arguments.empty ? std::map<std::string, double>{} : truth_of(scene, placements);
  return capture;
}

/// The models' plans hold in the search region: it has to hold what is rendered.
void widen_to(Scene& free, const std::vector<std::vector<Placement>>& captures) {
  for (Unknown& unknown : free.unknowns) {
    for (const std::vector<Placement>& placements : captures) {
      const double value =
          placements[static_cast<std::size_t>(unknown.object)].get(unknown.component);
      unknown.lower = std::min(unknown.lower, value);
      unknown.upper = std::max(unknown.upper, value);
    }
  }
}

/// What is odd about the poses, a line each on the standard error stream.
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
  const std::size_t count = std::max(placements.size(), sensors.size());
  for (const std::size_t size : {placements.size(), sensors.size()}) {
    if (size == 1 || size == count) continue;
    throw Error("render", "found " + std::to_string(placements.size()) +
                              " poses of the object and " + std::to_string(sensors.size()) +
                              " of the sensor, accepted: as many, or one of either");
  }
  std::vector<Scene> seen;  // [sensors]
  for (const Transform& pose : sensors) seen.push_back(seen_from(scene, pose));
  if (!arguments.empty) tell_placement_hints(seen, placements);
  CaptureFile file;
  file.bin_width = scene.sensor.bin_width;
  file.sensor = scene.sensor.name;
  file.description = "rendered from scene " + scene.name + " by the " + arguments.model + " model";
  file.captures.resize(count);
  std::optional<Progress> progress;
  std::optional<StageProgress> stages;
  if (count > 1) {
    progress.emplace("captures", count);
  } else {
    stages.emplace("rendering by the " + arguments.model + " model");
  }
  std::optional<Interruptible> interruptible;  // a single capture has nothing to keep
  if (count > 1) interruptible.emplace();
  tbb::parallel_for(std::size_t{0}, sensors.size(), [&](std::size_t s) {
    if (Interruptible::asked()) return;
    Scene free = fully_free(seen[s]);
    widen_to(free, placements);
    const SensorPlacement sensor = sensor_placement(free);
    const std::unique_ptr<ForwardModel> model =
        arguments.model == "fast"
            ? make_fast_model(free, sensor, arguments.fast)
            : make_reference_renderer(free, sensor, reference_options(arguments));
    const std::size_t first = sensors.size() == 1 ? 0 : s;
    const std::size_t end = sensors.size() == 1 ? count : s + 1;
    tbb::parallel_for(first, end, [&](std::size_t i) {
      if (Interruptible::asked()) return;
      file.captures[i] =
          render_one(arguments, seen[s], free, *model, placements[placements.size() == 1 ? 0 : i],
                     arguments.seed + 1'000'003 * (i + 1));
      file.captures[i].index = static_cast<int>(i);
      file.captures[i].source = arguments.output;
      if (progress) progress->advance();
    });
  });
  progress.reset();
  stages.reset();
  std::erase_if(file.captures, [](const Capture& c) { return c.counts.values.empty(); });
  const std::size_t done = file.captures.size();
  if (done > 0) write_captures(arguments.output, file);
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
  command.add_option("--model", arguments->model, "reference or fast")
      ->check(CLI::IsMember({"reference", "fast"}))
      ->capture_default_str();
  command.add_flag(
      "--noiseless", arguments->noiseless,
      "expected values: S plus static return times gain; no ambient light, no measured background");
  command.add_flag("--empty", arguments->empty, "no hidden object");
  command
      .add_option("--photons", arguments->photons,
                  "choose the exposure so that the third bounce gives this many photons, over an "
                  "equal background in its time gate")
      ->check(number_in({.lower = 0, .upper = 1e18, .above_lower = true}, "PHOTONS"));
  command.add_option("--tolerance", arguments->fast.tolerance, "of the fast model")
      ->capture_default_str();
  command
      .add_option("--reference-sampling", arguments->sampling,
                  "cells of the reference renderer along each axis, in units of the usual ones; "
                  "default: 1, above 100,000 photons 2")
      ->check(number_in({.lower = 0.1, .upper = 10}, "SCALE"));
  const CLI::Validator divisions = number_in({.lower = 1, .upper = 1000}, "INT");
  command.add_option("--zone-divisions", arguments->zone_divisions, "of the reference renderer")
      ->check(divisions);
  command.add_option("--field-divisions", arguments->field_divisions, "of the reference renderer")
      ->check(divisions);
  command.add_option("--seed", arguments->seed, "of poses and photons")->capture_default_str();
  command.callback([arguments, &exit_code] { exit_code = run_render(*arguments); });
}

}  // namespace blindcorner
