// SPDX-License-Identifier: Apache-2.0
/// `blindcorner benchmark solver --sweep`: error against run time of the solver's settings and of
/// other methods.
#include "commands/benchmark_sweep.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/baseline/cnn.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/simulation/claim_study.h"
#include "blindcorner/simulation/traced_scene.h"
#include "commands/commands.h"
#include "commands/interrupt.h"
#include "commands/number_check.h"
#include "commands/output_directory.h"
#include "commands/progress.h"
#include "io/json_reader.h"
#include "report/sweep_page.h"

namespace blindcorner {
namespace {

/// Scenes whose fits take tens of milliseconds.
const char* const kSweepScenes[] = {"scenes/denali_like.json", "scenes/tmf8828_floor.json",
                                    "scenes/tmf8828_wall.json"};

std::vector<SolverSetting> wanted_settings(const std::vector<std::string>& names) {
  std::vector<SolverSetting> settings = solver_settings();
  std::vector<std::string> known;
  for (const SolverSetting& s : settings) known.push_back(s.name);
  for (const std::string& name : names) {
    if (std::ranges::find(known, name) != known.end()) continue;
    const std::string near = nearest_word(name, known);
    std::string all;
    for (const std::string& one : known) all += (all.empty() ? "" : ", ") + one;
    throw Error("--settings", "found " + name +
                                  (near.empty() ? "" : " (did you mean " + near + "?)") +
                                  ", accepted: " + all);
  }
  // The default stays, because all others are compared with it.
  if (!names.empty()) {
    std::erase_if(settings, [&](const SolverSetting& s) {
      return s.name != known.front() && std::ranges::find(names, s.name) == names.end();
    });
  }
  return settings;
}

std::vector<SweptMethod> swept_methods(const Scene& scene,
                                       const std::vector<SolverSetting>& settings,
                                       const std::vector<CnnBaseline>& networks) {
  std::vector<SweptMethod> methods;
  for (const SolverSetting& setting : settings) methods.push_back(swept_setting(scene, setting));
  for (SweptMethod& baseline : swept_baselines(scene)) methods.push_back(std::move(baseline));
  for (const CnnBaseline& network : networks) {
    if (network.description().scene != scene.name) continue;
    network.check_scene(scene);
    methods.push_back(swept_network(
        scene, network, "network, " + cnn_architecture_name(network.description().network)));
  }
  return methods;
}

/// Throws Error if no wrong assumption has this name, before anything is written. Empty: none is
/// asked for.
void check_effect(const Scene& scene, const std::string& wrong) {
  std::string names;
  for (const WrongAssumption& known : wrong_assumptions(scene)) {
    if (known.name == wrong) return;
    names += (names.empty() ? "" : ", ") + known.name;
  }
  if (!wrong.empty()) throw Error("--wrong", "found " + wrong + ", accepted: " + names);
}

/// Says on the standard error stream what failed. Returns the number of failed captures.
int print_sweep_failures(const SweepScene& scene) {
  int failures = 0;
  for (const SweepLevel& level : scene.levels) {
    for (std::size_t m = 0; m < scene.methods.size(); ++m) {
      const auto& trials = level.cells[m].trials;
      const auto failed =
          std::ranges::find_if(trials, [](const SweepTrial& t) { return !t.error.empty(); });
      if (failed == trials.end()) continue;
      failures += level.figures[m].failures;
      std::fprintf(stderr, "blindcorner: %s, %g photons, %s: %d captures failed: %s\n",
                   scene.name.c_str(), level.photons, scene.methods[m].name.c_str(),
                   level.figures[m].failures, failed->error.c_str());
    }
  }
  return failures;
}

void write_sweep(const SweepReport& report, const std::string& output) {
  const std::filesystem::path directory(output);
  write_atomically((directory / "sweep.csv").string(), sweep_csv(report));
  write_atomically((directory / "sweep.json").string(), sweep_json(report).dump(1) + "\n");
  write_atomically((directory / "sweep.html").string(), sweep_page(report));
  write_atomically((directory / "sweep.svg").string(), sweep_svg(report));
}

}  // namespace

void add_sweep_options(CLI::App& command, SweepArguments& arguments) {
  const auto sweep = command.add_flag(
      "--sweep", arguments.wanted,
      "instead: error against run time of the solver's settings and of other methods at every "
      "level of light; writes DIR/sweep.html, .svg, .csv and .json; without SCENE three scenes");
  const auto of_sweep = [sweep](CLI::Option* option) {
    return option->needs(sweep)->group("with --sweep");
  };
  of_sweep(
      command.add_option("--photons", arguments.options.photons,
                         "of the object on average over the search region, a list with commas"))
      ->delimiter(',')
      ->check(positive_number());
  of_sweep(command.add_option("--light", arguments.light,
                              "whose light the captures hold: the reference renderer's, the "
                              "simulated sensor's, or at an archive's poses an independent path "
                              "tracer's"))
      ->check(CLI::IsMember({"reference", "sensor", "tracer"}));
  const char* data = std::getenv("BLINDCORNER_DATA");
  arguments.data = data != nullptr ? data : "../shared/data";
  of_sweep(command.add_option("--data", arguments.data,
                              "directory of the traced light, as of benchmark light"));
  of_sweep(command.add_option("--wrong", arguments.options.wrong,
                              "an effect that no method is told of, such as 'relay tilted by 2 "
                              "degrees'; another name lists them all"));
  of_sweep(command.add_option("--network", arguments.networks,
                              "weights.pt of cnn train, each for one of the scenes"));
  of_sweep(command.add_option("--settings", arguments.settings,
                              "names of settings, a list with commas; default: all"))
      ->delimiter(',');
}

int run_sweep(const SweepArguments& arguments, std::vector<std::string> scenes,
              const std::string& output, const Printout& out) {
  SweepReport report;
  report.options = arguments.options;
  report.options.light = arguments.light == "sensor" ? TrueLight::sensor : TrueLight::reference;
  report.options.validate();
  const bool traced = arguments.light == "tracer";
  if (traced && !report.options.wrong.empty()) {
    throw Error("--wrong", "found it with --light tracer, accepted: light of this program's own");
  }
  if (scenes.empty()) scenes.assign(std::begin(kSweepScenes), std::end(kSweepScenes));
  const std::vector<SolverSetting> settings = wanted_settings(arguments.settings);
  std::vector<CnnBaseline> networks;
  for (const std::string& path : arguments.networks) networks.push_back(CnnBaseline::load(path));
  std::vector<Scene> read;
  for (const std::string& path : scenes) read.push_back(read_scene(path));
  for (const Scene& scene : read) {
    check_effect(scene, report.options.wrong);
    swept_methods(scene, settings, networks);
  }
  make_directory(output);
  const Interruptible interruptible;
  int failures = 0;
  std::size_t levels = 0;
  for (const Scene& scene : read) {
    const std::vector<SweptMethod> methods = swept_methods(scene, settings, networks);
    Progress progress(scene.name, methods.size() * report.options.photons.size() *
                                      static_cast<std::size_t>(report.options.captures));
    if (traced) report.options.traced = traced_file(arguments.data, scene.path);
    SweepScene swept = sweep_scene(scene, methods, report.options, [&] {
      progress.advance();
      if (Interruptible::asked()) throw StudyInterrupted{};
    });
    progress.finish();
    levels += swept.levels.size();
    if (swept.levels.empty()) break;
    report.scenes.push_back(std::move(swept));
    out.text("%s\n", sweep_text(report.scenes.back()).c_str());
    failures += print_sweep_failures(report.scenes.back());
    report.verdict = verdict_of(report.scenes);
    write_sweep(report, output);
    if (Interruptible::asked()) break;
  }
  if (Interruptible::asked()) {
    tell_interrupted(levels, read.size() * report.options.photons.size(), "levels of light",
                     levels > 0 ? "tables and page hold these" : "");
    return kSomeFailed;
  }
  for (const std::string& remark : report.verdict.remarks()) out.text("%s\n", remark.c_str());
  out.file((std::filesystem::path(output) / "sweep.json").string());
  out.text("%s\n%s\n", (std::filesystem::path(output) / "sweep.html").string().c_str(),
           report.verdict.headline().c_str());
  return failures > 0 || !report.verdict.better.empty() ? kSomeFailed : kAllWell;
}

}  // namespace blindcorner
