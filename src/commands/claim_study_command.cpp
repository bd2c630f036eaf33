// SPDX-License-Identifier: Apache-2.0
#include "commands/claim_study_command.h"

#include "blindcorner/forward/error.h"
#include "blindcorner/io/random_scene.h"
#include "commands/number_check.h"

namespace blindcorner {
namespace {

/// Number of random scenes that each seed has for itself.
constexpr std::uint64_t kScenesOfASeed = 10'000;

}  // namespace

std::vector<StudiedScene> studied_scenes(const ClaimStudyArguments& arguments, std::uint64_t seed) {
  if (arguments.scenes.empty() && arguments.random == 0) {
    throw Error("SCENE", "found none, accepted: scene files, or a number of scenes for --random");
  }
  std::vector<StudiedScene> scenes;
  for (const std::string& path : arguments.scenes) scenes.push_back({read_scene(path), {}});
  if (arguments.random == 0) return scenes;
  const std::filesystem::path directory = std::filesystem::path(arguments.output) / "scenes";
  make_directory(directory.string());
  for (int k = 0; k < arguments.random; ++k) {
    const RandomScene random = random_scene(kScenesOfASeed * seed + static_cast<std::uint64_t>(k));
    const std::string path = (directory / (random.name + ".json")).string();
    if (!random.mesh.empty()) {
      write_atomically((directory / (random.name + ".obj")).string(), random.mesh);
    }
    write_atomically(path, random.text);
    scenes.push_back({read_scene(path), {random.photons}});
  }
  return scenes;
}

void add_claim_study_options(CLI::App& command, ClaimStudyArguments& arguments,
                             ClaimStudyOptions& options) {
  command.add_option("SCENE", arguments.scenes, "scene files");
  command
      .add_option("--random", arguments.random,
                  "scenes drawn at random by --seed, each with a light of its own from 10 to 10^7 "
                  "photons; their files go to DIR/scenes")
      ->check(CLI::Range(0, 10'000));
  command
      .add_option("-n,--captures", options.captures,
                  "captures with an object, of each scene and level of light")
      ->check(CLI::Range(1, 10'000'000));
  command.add_option("-o,--output", arguments.output, "directory to write to");
  command
      .add_option(
          "--photons", options.photons,
          "of the object on average over the search region, a list with commas" +
              std::string(options.photons.empty() ? "; default: the scene's own exposure" : ""))
      ->delimiter(',')
      ->check(positive_number());
  command
      .add_option("--light", arguments.light,
                  "whose light the captures hold: the reference renderer's or the simulated "
                  "sensor's")
      ->check(CLI::IsMember({"reference", "sensor"}));
  command
      .add_option("--truth", options.sampling,
                  "sampling of the captures, in units of the reference renderer's default")
      ->check(CLI::Range(0.1, 10.0));
  command.add_option("--seed", options.seed, "of poses, brightness and photons");
  arguments.out.add_option(command, "the study's .json file");
  command.add_option("--threads", arguments.threads, "0: one per processor")
      ->check(CLI::Range(0, 1024));
}

}  // namespace blindcorner
