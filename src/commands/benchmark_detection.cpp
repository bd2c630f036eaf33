// SPDX-License-Identifier: Apache-2.0
/// `blindcorner benchmark detection`: objects found and false alarms, at every level of light.
#include <memory>

#include "commands/benchmark.h"
#include "commands/claim_study_command.h"
#include "report/detection_page.h"

namespace blindcorner {
namespace {

struct DetectionArguments {
  ClaimStudyArguments study;
  DetectionOptions options;
};

const ClaimStudy<DetectionOptions, DetectionLevel> kDetectionStudy{
    "detection",
    [](const Scene&, const DetectionOptions& options) {
      return options.photons.size() *
             static_cast<std::size_t>(options.captures + options.empty_captures);
    },
    study_detection,
    detection_text,
    detection_headline,
    nullptr,
    [](const DetectionReport& report) {
      return std::vector<std::pair<std::string, std::string>>{
          {"detection.csv", detection_csv(report)},
          {"false_alarms.csv", false_alarms_csv(report)},
          {"roc.csv", roc_csv(report)},
          {"detection.json", detection_json(report).dump(1) + "\n"},
          {"detection.html", detection_page(report)}};
    }};

}  // namespace

void add_detection_benchmark(CLI::App& benchmark, int& exit_code) {
  CLI::App& command = *benchmark.add_subcommand(
      "detection",
      "objects found against false alarms, and whether the stated false-alarm probability is met; "
      "writes DIR/detection.html, .csv and .json; exit code 1: it is not");
  const auto arguments = std::make_shared<DetectionArguments>();
  DetectionOptions& options = arguments->options;
  add_claim_study_options(command, arguments->study, options);
  command
      .add_option("--empty", options.empty_captures, "captures without one, at each level of light")
      ->check(CLI::Range(1, 10'000'000));
  command
      .add_option("--calibrated-on", options.fit.empty_captures,
                  "empty captures that the fit simulates to calibrate itself")
      ->check(CLI::Range(16, 1'000'000));
  command.callback([arguments, &exit_code] {
    exit_code = run_claim_study(kDetectionStudy, arguments->study, arguments->options);
  });
}

}  // namespace blindcorner
