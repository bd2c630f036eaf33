// SPDX-License-Identifier: Apache-2.0
/// `blindcorner benchmark coverage`: whether the fit's uncertainty is what it says.
#include <algorithm>
#include <memory>

#include "commands/benchmark.h"
#include "commands/claim_study_command.h"
#include "commands/number_check.h"
#include "report/coverage_page.h"

namespace blindcorner {
namespace {

struct CoverageArguments {
  ClaimStudyArguments study;
  bool wrong = false;
  CoverageOptions options;
};

const ClaimStudy<CoverageOptions, CoverageLevel> kCoverageStudy{
    "coverage",
    [](const Scene& scene, const CoverageOptions& options) {
      std::size_t wrong = 0;
      for (const WrongAssumption& a : wrong_assumptions(scene)) wrong += a.left_out.empty() ? 1 : 0;
      const std::size_t levels = std::max<std::size_t>(1, options.photons.size());
      return levels * (static_cast<std::size_t>(options.captures) +
                       wrong * static_cast<std::size_t>(options.wrong_captures));
    },
    study_coverage,
    coverage_text,
    coverage_headline,
    coverage_summary,
    [](const CoverageReport& report) {
      std::vector<std::pair<std::string, std::string>> files{
          {"coverage.csv", coverage_csv(report)},
          {"coverage.json", coverage_json(report).dump(1) + "\n"},
          {"coverage.html", coverage_page(report)}};
      if (report.options.wrong_captures > 0) {
        files.emplace_back("wrong_assumptions.csv", wrong_assumptions_csv(report));
      }
      return files;
    }};

}  // namespace

void add_coverage_benchmark(CLI::App& benchmark, int& exit_code) {
  CLI::App& command = *benchmark.add_subcommand(
      "coverage",
      "whether the uncertainty is what it says, on captures whose poses and brightness come from "
      "the priors; writes DIR/coverage.html, .csv and .json; exit code 1: a claim does not hold");
  const auto arguments = std::make_shared<CoverageArguments>();
  CoverageOptions& options = arguments->options;
  add_claim_study_options(command, arguments->study, options);
  command.add_flag("--wrong-assumptions", arguments->wrong,
                   "also captures of scenes that are not what the fit is told; writes "
                   "wrong_assumptions.csv as well");
  command
      .add_option("--wrong-captures", options.wrong_captures,
                  "of each wrong assumption, at most as many as -n")
      ->check(CLI::Range(1, 10'000'000));
  command.add_flag("--dense-truth", options.dense_truth,
                   "sampling of the captures as dense as it must be, from half of --truth to 1.4 "
                   "times; scenes of --random have it");
  command.add_option("--importance-samples", options.fit.importance_samples, "of the fit")
      ->check(number_from_zero());
  command.callback([arguments, &options, &exit_code] {
    options.wrong_captures =
        arguments->wrong ? std::min(options.wrong_captures, options.captures) : 0;
    options.dense_truth = options.dense_truth || arguments->study.random > 0;
    exit_code = run_claim_study(kCoverageStudy, arguments->study, options);
  });
}

}  // namespace blindcorner
