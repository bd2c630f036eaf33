// SPDX-License-Identifier: Apache-2.0
/// `blindcorner bound SCENE`: the error to expect over the hidden area, before there is a capture.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/bound/error_bound.h"
#include "blindcorner/inverse/hints.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/simulation/sensor_path.h"
#include "blindcorner/simulation/synthetic.h"
#include "commands/capture_inputs.h"
#include "commands/commands.h"
#include "commands/number_check.h"
#include "commands/output_directory.h"
#include "commands/pose_text.h"
#include "commands/printout.h"
#include "commands/progress.h"
#include "forward/support/parallel.h"
#include "report/bound_page.h"

namespace blindcorner {
namespace {

struct BoundArguments {
  std::string scene, output, pose, capture;
  std::vector<std::string> sensor_poses;
  std::optional<double> yaw_deg;
  int grid = 24;
  double photons = 0;
  Printout out;
  BoundOptions options;
};

/// Index of the first object's unknown for a component. Empty: the component is known.
std::optional<std::size_t> unknown_of(const Scene& scene, Component component) {
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    if (scene.unknowns[i].component == component && scene.unknowns[i].object == 0) return i;
  }
  return std::nullopt;
}

/// The scene's own exposure, or what --photons asks for.
void set_light(const BoundArguments& arguments, const Scene& scene, const SensorPlacement& sensor,
               BoundOptions& options) {
  Exposure exposure = own_exposure(scene);
  if (arguments.photons > 0) {
    FastModelOptions fast;
    fast.tolerance = options.model_tolerance;
    exposure =
        exposure_for(scene, *make_fast_model(scene, sensor, fast), arguments.photons, options.seed);
  }
  options.exposures = exposure.exposures;
  options.ambient = exposure.ambient;
}

/// Centres of cells along a coordinate. A known coordinate has a single one, at its value.
std::vector<double> centres(const Scene& scene, const std::optional<std::size_t>& unknown,
                            double cell, double known) {
  if (!unknown) return {known};
  const Unknown& u = scene.unknowns[*unknown];
  const int count = std::max(1, static_cast<int>(std::lround(u.range() / cell)));
  std::vector<double> values;
  for (int i = 0; i < count; ++i) {
    values.push_back(u.lower + u.range() * (i + 0.5) / count);
  }
  return values;
}

/// The pose whose other components are held while x and y move.
PoseVector held_pose(const BoundArguments& arguments, const Scene& scene) {
  PoseVector pose =
      pose_of(arguments.pose.empty() ? stated_placements(scene) : parse_pose(scene, arguments.pose),
              scene.unknowns);
  if (arguments.yaw_deg) {
    const auto yaw = unknown_of(scene, Component::yaw);
    if (!yaw) {
      throw Error("--yaw", "found a yaw, accepted: none, because " + scene_place(scene) +
                               " does not leave it open");
    }
    pose[static_cast<Eigen::Index>(*yaw)] = *arguments.yaw_deg * kDegree;
  }
  for (Eigen::Index i = 0; i < pose.size(); ++i) {
    const Unknown& u = scene.unknowns[static_cast<std::size_t>(i)];
    if (pose[i] >= u.lower - 1e-9 && pose[i] <= u.upper + 1e-9) continue;
    throw Error(u.component == Component::yaw && arguments.yaw_deg ? "--yaw" : "--pose",
                unknown_name(scene, u) + ": found " + std::to_string(pose[i]) +
                    ", accepted: " + std::to_string(u.lower) + " to " + std::to_string(u.upper));
  }
  return pose;
}

BoundMap map_of(const BoundArguments& arguments, const Scene& scene, const SensorPlacement& sensor,
                const std::string& name, const BoundOptions& options) {
  const PoseVector held = held_pose(arguments, scene);
  const auto x = unknown_of(scene, Component::x), y = unknown_of(scene, Component::y);
  if (!x && !y) {
    throw Error(scene_place(scene) + ": unknowns",
                "found neither x_m nor y_m of the first object, accepted: at least one of them");
  }
  double longest = 0;
  for (const auto& unknown : {x, y}) {
    if (unknown) longest = std::max(longest, scene.unknowns[*unknown].range());
  }
  BoundMap map;
  map.name = name;
  map.scene = scene;
  map.relay_points = sensor.relay_points;
  map.options = options;
  map.hints = scene_hints(scene, sensor);
  const double cell = longest / arguments.grid;
  const Placement known = placements_at(scene, held).front();
  map.x_m = centres(scene, x, cell, known.position.x());
  map.y_m = centres(scene, y, cell, known.position.y());
  map.cell = {x ? scene.unknowns[*x].range() / static_cast<double>(map.x_m.size()) : cell,
              y ? scene.unknowns[*y].range() / static_cast<double>(map.y_m.size()) : cell};
  const std::size_t count = map.x_m.size() * map.y_m.size();
  Progress progress(name, count + static_cast<std::size_t>(options.test_poses));
  const ErrorBound bound(scene, sensor, options, [&] { progress.advance(); });
  map.prior_error = bound.prior_error();
  map.places.resize(count);
  parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    PoseVector pose = held;
    if (x) pose[static_cast<Eigen::Index>(*x)] = map.x_m[i % map.x_m.size()];
    if (y) pose[static_cast<Eigen::Index>(*y)] = map.y_m[i / map.x_m.size()];
    map.places[i] = bound.at(pose);
    progress.advance();
  });
  progress.finish();
  return map;
}

std::vector<BoundMap> maps_of(const BoundArguments& arguments) {
  const Scene scene = read_scene(arguments.scene);
  held_pose(arguments, scene);  // so that a wrong one is named before anything is computed
  BoundOptions options = arguments.options;
  std::vector<BoundMap> maps;
  if (arguments.sensor_poses.empty()) {
    const SensorPlacement sensor = known_placement(scene, arguments.capture);
    set_light(arguments, scene, sensor, options);
    maps.push_back(map_of(arguments, scene, sensor, "the scene's sensor pose", options));
    return maps;
  }
  std::vector<Scene> seen;
  for (const std::string& text : arguments.sensor_poses) {
    seen.push_back(seen_from(scene, parse_sensor_pose(scene, "--sensor-pose", text)));
  }
  set_light(arguments, seen.front(), sensor_placement(seen.front()), options);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    maps.push_back(
        map_of(arguments, seen[i], sensor_placement(seen[i]), arguments.sensor_poses[i], options));
  }
  return maps;
}

int run_bound(const BoundArguments& arguments) {
  const std::vector<BoundMap> maps = maps_of(arguments);
  for (const BoundMap& map : maps) {
    arguments.out.text("%s\n  %s\n", map.name.c_str(), bound_headline(map).c_str());
    for (const std::string& hint : map.hints) {
      std::fprintf(stderr, "blindcorner: hint: %s\n", hint.c_str());
    }
  }
  arguments.out.document(bound_json(maps));
  if (arguments.output.empty()) return kAllWell;
  make_directory(arguments.output);
  const std::filesystem::path directory(arguments.output);
  write_atomically((directory / "bound.json").string(), bound_json(maps));
  write_atomically((directory / "bound.csv").string(), bound_csv(maps));
  write_atomically((directory / "bound.html").string(), bound_page(maps));
  arguments.out.text("%s\n", (directory / "bound.html").string().c_str());
  return kAllWell;
}

}  // namespace

void add_bound_command(CLI::App& app, int& exit_code) {
  CLI::App& command = *app.add_subcommand(
      "bound", "the error to expect over the hidden area, and where nothing would be detected");
  const auto arguments = std::make_shared<BoundArguments>();
  command.add_option("SCENE", arguments->scene, "scene file")->required();
  command.add_option("-o,--output", arguments->output,
                     "directory for bound.json, bound.csv and a page; default: the headline alone");
  command.add_option("--grid", arguments->grid, "places along the longer side of the map")
      ->check(CLI::Range(1, 500));
  command
      .add_option("--photons", arguments->photons,
                  "choose the exposure so that the third bounce gives this many photons on average "
                  "over the search region (at the first sensor pose), over an equal background; "
                  "default: the scene's own light")
      ->check(positive_number());
  command.add_option("--pose", arguments->pose,
                     "what else is unknown, such as z_m=0.9,yaw_deg=20; components left out keep "
                     "the scene's values");
  command.add_option("--yaw", arguments->yaw_deg, "the object's yaw, degrees");
  command.add_option("--sensor-pose", arguments->sensor_poses,
                     "pose of the sensor, such as x_m=1,yaw_deg=10; may be repeated to compare "
                     "several; components left out keep the scene's values");
  command.add_option("--capture", arguments->capture,
                     "capture file whose first capture says where the sensor stood");
  command
      .add_option("--test-poses", arguments->options.test_poses,
                  "poses that each place may be mistaken for")
      ->check(CLI::Range(1, 100'000));
  command.add_flag("!--no-prior", arguments->options.prior,
                   "leave what the scene says about the pose out of the Cramer-Rao bound");
  command.add_option("--tolerance", arguments->options.model_tolerance, "of the fast model");
  arguments->out.add_option(command, "bound.json");
  command.add_option("--seed", arguments->options.seed, "of simulated empty captures");
  command.callback([arguments, &exit_code] {
    arguments->options.validate();
    exit_code = run_bound(*arguments);
  });
}

}  // namespace blindcorner
