// SPDX-License-Identifier: Apache-2.0
#include "commands/benchmark.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>

#include "blindcorner/forward/error.h"
#include "commands/commands.h"

namespace blindcorner {

std::vector<std::string> benchmark_scenes(const std::vector<std::string>& asked) {
  if (!asked.empty()) return asked;
  namespace fs = std::filesystem;
  std::vector<std::string> scenes;
  if (fs::is_directory("scenes")) {
    for (const auto& entry : fs::directory_iterator("scenes")) {
      if (entry.path().extension() == ".json") scenes.push_back(entry.path().string());
    }
  }
  if (scenes.empty()) throw Error("SCENE", "found none, accepted: scene files, or a folder scenes");
  std::sort(scenes.begin(), scenes.end());
  return scenes;
}

void add_benchmark_command(CLI::App& app, int& exit_code) {
  CLI::App& benchmark = *app.add_subcommand("benchmark", "measure accuracy and run time");
  benchmark.require_subcommand(1);
  add_solver_benchmark(benchmark, exit_code);
  add_forward_benchmark(benchmark, exit_code);
  add_derivatives_benchmark(benchmark, exit_code);
}

}  // namespace blindcorner
