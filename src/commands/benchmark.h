// SPDX-License-Identifier: Apache-2.0
/// The family `blindcorner benchmark ...`.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "blindcorner/forward/transport/forward_model.h"
#include "commands/commands.h"
#include "commands/printout.h"
#include "report/chart.h"

namespace blindcorner {

void add_solver_benchmark(CLI::App& benchmark, int& exit_code);
void add_forward_benchmark(CLI::App& benchmark, int& exit_code);
void add_derivatives_benchmark(CLI::App& benchmark, int& exit_code);
void add_light_benchmark(CLI::App& benchmark, int& exit_code);
void add_moving_benchmark(CLI::App& benchmark, int& exit_code);
void add_planner_benchmark(CLI::App& benchmark, int& exit_code);
void add_vehicles_benchmark(CLI::App& benchmark, int& exit_code);
void add_drives_benchmark(CLI::App& benchmark, int& exit_code);
void add_coverage_benchmark(CLI::App& benchmark, int& exit_code);
void add_detection_benchmark(CLI::App& benchmark, int& exit_code);

/// What studies of the forward models are told.
struct StudyArguments {
  std::vector<std::string> scenes;  ///< files; none: those of the folder `scenes` here
  std::string output = "out/benchmark";
  int poses = 2;  ///< per scene
  std::uint64_t seed = 1;
  Printout out;
};
void add_study_options(CLI::App& command, StudyArguments& arguments, int most_poses);

FastModelOptions at_tolerance(double tolerance);

/// The files asked for; without any those of the folder `scenes` here, sorted. Throws Error when
/// there is none.
std::vector<std::string> scene_files(const std::vector<std::string>& asked);

/// Calls `study` with each scene and its own sensor placement. Scenes whose relay points come with
/// each capture are named on standard output and left out. Throws Error when there is no scene.
void for_each_scene(const StudyArguments& arguments,
                    const std::function<void(const Scene&, const SensorPlacement&)>& study);

/// How a study's files are called, and what its page says above the charts.
struct StudyFiles {
  std::string name;  ///< of the files, without extension
  std::string title, text;
};

/// Writes the table and the page, each completely or not at all.
void write_study(const StudyArguments& arguments, const StudyFiles& files, const std::string& csv,
                 const std::vector<Chart>& charts);
/// Says on standard output where they are; with --json it prints the table.
void print_study_files(const StudyArguments& arguments, const StudyFiles& files);

}  // namespace blindcorner
