// SPDX-License-Identifier: Apache-2.0
/// Studies of claims as commands: `benchmark coverage` and `benchmark detection`.
#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/simulation/claim_study.h"
#include "commands/commands.h"
#include "commands/interrupt.h"
#include "commands/output_directory.h"
#include "commands/printout.h"
#include "commands/progress.h"
#include "commands/thread_limit.h"

namespace blindcorner {

/// Arguments of every study of claims, beside its options.
struct ClaimStudyArguments {
  std::vector<std::string> scenes;
  std::string output = "out/benchmark", light = "reference";
  int threads = 0;
  Printout out;
  int random = 0;  ///< scenes drawn at random, beside those that are named
};

/// A scene of a study, and the levels of light that it comes with. None: those that the study asks
/// for.
struct StudiedScene {
  Scene scene;
  std::vector<double> photons;
};

/// The scenes that are named, and those drawn at random, whose files go to OUTPUT/scenes. Throws
/// Error where there is none.
std::vector<StudiedScene> studied_scenes(const ClaimStudyArguments& arguments, std::uint64_t seed);

/// Declares the arguments and options that all such commands have.
void add_claim_study_options(CLI::App& command, ClaimStudyArguments& arguments,
                             ClaimStudyOptions& options);

/// One of these studies: its name, which its files have too; the number of fits that a scene takes,
/// for the progress bar; the study of a scene; the text about a scene; the sentence that ends the
/// output; the summary; and the files by name, the page among them.
template <class Options, class Level>
struct ClaimStudy {
  using Report = StudyReport<Options, Level>;

  const char* name;
  std::size_t (*fits)(const Scene&, const Options&);
  StudyScene<Level> (*study)(const Scene&, const Options&, const std::function<void()>&);
  std::string (*text)(const StudyScene<Level>&);
  std::string (*headline)(const Report&);
  std::string (*summary)(const Report&);  ///< of several scenes, after their texts
  std::vector<std::pair<std::string, std::string>> (*files)(const Report&);
};

/// Runs a study on all scenes, judges their claims together, and writes and prints the results. The
/// files are written after each scene. Returns the exit code.
template <class Options, class Level>
int run_claim_study(const ClaimStudy<Options, Level>& study, const ClaimStudyArguments& arguments,
                    Options options) {
  const ThreadLimit threads(arguments.threads);
  options.light = arguments.light == "sensor" ? TrueLight::sensor : TrueLight::reference;
  options.validate();
  StudyReport<Options, Level> report{options, {}};
  make_directory(arguments.output);
  const std::vector<StudiedScene> scenes = studied_scenes(arguments, options.seed);
  const Interruptible interruptible;
  const std::filesystem::path directory(arguments.output);
  std::size_t levels = 0;
  bool all_hold = true;
  for (const auto& [scene, photons] : scenes) {
    Options own = options;
    if (!photons.empty()) own.photons = photons;
    Progress progress(scene.name, study.fits(scene, own));
    auto studied = study.study(scene, own, [&] {
      progress.advance();
      if (Interruptible::asked()) throw StudyInterrupted{};
    });
    levels += studied.levels.size();
    if (!studied.levels.empty()) {
      report.scenes.push_back(std::move(studied));
      // Page and tables grow with each scene, so that a run that ends early leaves those of its
      // scenes.
      all_hold = judge_study(report.scenes);
      for (const auto& [name, text] : study.files(report)) {
        write_atomically((directory / name).string(), text);
      }
    }
    if (Interruptible::asked()) break;
  }
  if (Interruptible::asked()) {
    tell_interrupted(levels, scenes.size() * std::max<std::size_t>(1, options.photons.size()),
                     "levels of light", levels > 0 ? "tables and page hold these" : "");
    if (levels == 0) return kSomeFailed;
  }
  int failures = 0;
  for (const StudyScene<Level>& scene : report.scenes) {
    arguments.out.text("%s\n", study.text(scene).c_str());
    for (const Level& level : scene.levels) failures += level.failures;
  }
  if (report.scenes.size() > 1 && study.summary != nullptr) {
    arguments.out.text("%s\n", study.summary(report).c_str());
  }
  arguments.out.file((directory / (std::string(study.name) + ".json")).string());
  arguments.out.text("%s\n%s\n", (directory / (std::string(study.name) + ".html")).string().c_str(),
                     study.headline(report).c_str());
  return all_hold && failures == 0 && !Interruptible::asked() ? kAllWell : kSomeFailed;
}

}  // namespace blindcorner
