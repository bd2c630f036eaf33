// SPDX-License-Identifier: Apache-2.0
/// `blindcorner benchmark coverage`: whether the fit's uncertainty is what it says.
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
#include "report/coverage_page.h"

namespace blindcorner {
namespace {

struct CoverageArguments {
  std::vector<std::string> scenes;
  std::string output = "out/benchmark", light = "reference";
  bool wrong = false;
  int threads = 0;
  CoverageOptions options;
};

std::size_t fits_of(const Scene& scene, const CoverageOptions& options) {
  std::size_t wrong = 0;
  for (const WrongAssumption& a : wrong_assumptions(scene)) wrong += a.left_out.empty() ? 1 : 0;
  const std::size_t levels = std::max<std::size_t>(1, options.photons.size());
  return levels * (static_cast<std::size_t>(options.captures) +
                   wrong * static_cast<std::size_t>(options.wrong_captures));
}

void write_coverage(const CoverageReport& report, const std::string& output) {
  const std::filesystem::path directory(output);
  write_atomically((directory / "coverage.csv").string(), coverage_csv(report));
  if (report.options.wrong_captures > 0) {
    write_atomically((directory / "wrong_assumptions.csv").string(), wrong_assumptions_csv(report));
  }
  write_atomically((directory / "coverage.json").string(), coverage_json(report).dump(1) + "\n");
  write_atomically((directory / "coverage.html").string(), coverage_page(report));
}

int run_coverage(CoverageArguments arguments) {
  const ThreadLimit threads(arguments.threads);
  CoverageReport report;
  report.options = arguments.options;
  report.options.light = arguments.light == "sensor" ? TrueLight::sensor : TrueLight::reference;
  if (!arguments.wrong) report.options.wrong_captures = 0;
  report.options.wrong_captures = std::min(report.options.wrong_captures, report.options.captures);
  report.options.validate();
  std::vector<Scene> scenes;
  for (const std::string& path : arguments.scenes) scenes.push_back(read_scene(path));
  make_directory(arguments.output);
  for (const Scene& scene : scenes) {
    Progress progress(scene.name, fits_of(scene, report.options));
    report.scenes.push_back(study_coverage(scene, report.options, [&] { progress.advance(); }));
  }
  const bool all_hold = judge_coverage(report.scenes);
  for (const CoverageScene& scene : report.scenes) {
    std::printf("%s\n", coverage_text(scene).c_str());
  }
  write_coverage(report, arguments.output);
  std::printf("%s\n%s\n",
              (std::filesystem::path(arguments.output) / "coverage.html").string().c_str(),
              coverage_headline(report).c_str());
  return all_hold ? kAllWell : kSomeFailed;
}

}  // namespace

void add_coverage_benchmark(CLI::App& benchmark, int& exit_code) {
  CLI::App& command = *benchmark.add_subcommand(
      "coverage",
      "whether the uncertainty is what it says, on captures whose poses and brightness come from "
      "the priors; writes DIR/coverage.html, .csv and .json; exit code 1: a claim does not hold");
  const auto arguments = std::make_shared<CoverageArguments>();
  command.add_option("SCENE", arguments->scenes, "scene files")->required();
  command.add_option("-n,--captures", arguments->options.captures, "captures of each scene")
      ->check(CLI::Range(2, 10'000'000))
      ->capture_default_str();
  command.add_option("-o,--output", arguments->output, "directory to write to")
      ->capture_default_str();
  command
      .add_option("--photons", arguments->options.photons,
                  "of the object on average over the search region, a list with commas; default: "
                  "the scene's own exposure")
      ->delimiter(',')
      ->check(CLI::PositiveNumber);
  command.add_flag("--wrong-assumptions", arguments->wrong,
                   "also captures of scenes that are not what the fit is told; writes "
                   "wrong_assumptions.csv as well");
  command
      .add_option("--wrong-captures", arguments->options.wrong_captures,
                  "of each wrong assumption, at most as many as -n")
      ->check(CLI::Range(1, 10'000'000))
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
  command
      .add_option("--importance-samples", arguments->options.fit.importance_samples, "of the fit")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command.add_option("--seed", arguments->options.seed, "of poses, brightness and photons")
      ->capture_default_str();
  command.add_option("--threads", arguments->threads, "0: one per processor")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  command.callback([arguments, &exit_code] { exit_code = run_coverage(*arguments); });
}

}  // namespace blindcorner
