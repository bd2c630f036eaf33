// SPDX-License-Identifier: Apache-2.0
#include "commands/benchmark.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <functional>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/scene_file.h"
#include "commands/output_directory.h"
#include "report/html.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;

std::string study_path(const StudyArguments& arguments, const std::string& name) {
  return (fs::path(arguments.output) / name).string();
}

}  // namespace

std::vector<std::string> scene_files(const std::vector<std::string>& asked) {
  if (!asked.empty()) return asked;
  std::vector<std::string> scenes;
  if (fs::is_directory("scenes")) {
    for (const auto& entry : fs::directory_iterator("scenes")) {
      const std::string path = entry.path().string();
      if (path.ends_with(".json") && !path.ends_with("_drive.json")) scenes.push_back(path);
    }
  }
  if (scenes.empty()) throw Error("SCENE", "found none, accepted: scene files, or a folder scenes");
  std::sort(scenes.begin(), scenes.end());
  return scenes;
}

void add_study_options(CLI::App& command, StudyArguments& arguments, int most_poses) {
  command.add_option("SCENE", arguments.scenes, "scene files; default: those in scenes/");
  command.add_option("-o,--output", arguments.output, "directory to write to");
  command.add_option("--poses", arguments.poses, "poses per scene")
      ->check(CLI::Range(1, most_poses));
  command.add_option("--seed", arguments.seed, "of the poses");
  arguments.out.add_option(command, "the rows of the table (.csv)");
}

FastModelOptions at_tolerance(double tolerance) {
  FastModelOptions options;
  options.tolerance = tolerance;
  return options;
}

void for_each_scene(const StudyArguments& arguments,
                    const std::function<void(const Scene&, const SensorPlacement&)>& study) {
  for (const std::string& path : scene_files(arguments.scenes)) {
    const Scene scene = read_scene(path);
    const SensorPlacement sensor = sensor_placement(scene);
    if (std::ranges::all_of(sensor.relay_points, [](const auto& p) { return p.allFinite(); })) {
      study(scene, sensor);
    } else {
      arguments.out.text("%-18s left out: its zones come with each capture\n", scene.name.c_str());
    }
  }
}

void write_study(const StudyArguments& arguments, const std::string& name, const std::string& csv,
                 const std::string& page) {
  make_directory(arguments.output);
  write_atomically(study_path(arguments, name + ".csv"), csv);
  write_atomically(study_path(arguments, name + ".html"), page);
}

std::string study_page(const std::string& title, const std::string& text,
                       const std::vector<TableRow>& rows, const std::vector<Chart>& charts) {
  return plain_page(title, "",
                    "<p>" + html_safe(text) + "</p>\n" + table_html(rows) + charts_html(charts));
}

void print_study_files(const StudyArguments& arguments, const std::string& name) {
  const std::string csv = study_path(arguments, name + ".csv");
  arguments.out.file(csv);
  arguments.out.text("%s and %s\n", csv.c_str(), study_path(arguments, name + ".html").c_str());
}

void add_benchmark_command(CLI::App& app, int& exit_code) {
  CLI::App& benchmark = *app.add_subcommand("benchmark", "measure accuracy and run time");
  benchmark.require_subcommand(1);
  add_solver_benchmark(benchmark, exit_code);
  add_forward_benchmark(benchmark, exit_code);
  add_derivatives_benchmark(benchmark, exit_code);
  add_light_benchmark(benchmark, exit_code);
  add_moving_benchmark(benchmark, exit_code);
  add_planner_benchmark(benchmark, exit_code);
  add_vehicles_benchmark(benchmark, exit_code);
  add_drives_benchmark(benchmark, exit_code);
  add_coverage_benchmark(benchmark, exit_code);
  add_detection_benchmark(benchmark, exit_code);
}

}  // namespace blindcorner
