// SPDX-License-Identifier: Apache-2.0
#include "commands/claim_study_command.h"

#include "commands/number_check.h"

namespace blindcorner {

void add_claim_study_options(CLI::App& command, ClaimStudyArguments& arguments,
                             ClaimStudyOptions& options) {
  command.add_option("SCENE", arguments.scenes, "scene files")->required();
  command
      .add_option("-n,--captures", options.captures,
                  "captures with an object, of each scene and level of light")
      ->check(CLI::Range(1, 10'000'000))
      ->capture_default_str();
  command.add_option("-o,--output", arguments.output, "directory to write to")
      ->capture_default_str();
  CLI::Option& photons =
      *command
           .add_option(
               "--photons", options.photons,
               "of the object on average over the search region, a list with commas" +
                   std::string(options.photons.empty() ? "; default: the scene's own exposure"
                                                       : ""))
           ->delimiter(',')
           ->check(positive_number());
  if (!options.photons.empty()) photons.capture_default_str();
  command
      .add_option("--light", arguments.light,
                  "whose light the captures hold: the reference renderer's or the simulated "
                  "sensor's")
      ->check(CLI::IsMember({"reference", "sensor"}))
      ->capture_default_str();
  command
      .add_option("--truth", options.sampling,
                  "sampling of the captures, in units of the reference renderer's default")
      ->check(CLI::Range(0.1, 10.0))
      ->capture_default_str();
  command.add_option("--seed", options.seed, "of poses, brightness and photons")
      ->capture_default_str();
  command.add_option("--threads", arguments.threads, "0: one per processor")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
}

}  // namespace blindcorner
