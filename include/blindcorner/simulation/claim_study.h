// SPDX-License-Identifier: Apache-2.0
/// Common frame of the studies that test the claims of fits. Captures show objects drawn from a
/// scene's priors, at several levels of light. All claims are judged together.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "blindcorner/inverse/fit.h"
#include "blindcorner/simulation/claim_tests.h"
#include "blindcorner/simulation/drawn_objects.h"

namespace blindcorner {

struct ClaimStudyOptions {
  int captures = 200;  ///< captures with an object, per scene and level of light; right model
  /// Photons of the third bounce, averaged over the search region, as in exposure_for(). Empty: the
  /// scene's own exposure.
  std::vector<double> photons;
  TrueLight light = TrueLight::reference;
  double sampling = 1.0;  ///< sampling of the reference renderer, as in DrawOptions::sampling
  FitOptions fit;
  std::uint64_t seed = 1;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// One level of light of a scene, and the claims made at this level.
struct ClaimLevel {
  std::optional<double> photons;  ///< empty: the scene's own exposure
  Exposure exposure;
  std::uint64_t seed = 0;  ///< seed of the captures, far from the seeds of other levels
  std::vector<ClaimTest> claims;
  int failures = 0;  ///< captures without an answer
};

/// Largest part that the truth's own sampling may add to the mean squared normalised error: the
/// smallest part that 2000 captures of two unknowns can show.
inline constexpr double kMaxTruthError = 0.05;

/// One scene of a study. `Level` is a ClaimLevel with the results that the study adds.
template <class Level>
struct StudyScene {
  Scene scene;
  std::vector<Level> levels;
};

/// Options and results of a study.
template <class Options, class Level>
struct StudyReport {
  Options options;
  std::vector<StudyScene<Level>> scenes;  ///< scenes with judged claims
};

/// How a study's objects are drawn.
DrawOptions draw_options(const ClaimStudyOptions& options);

/// The levels of light that the options ask for, without claims yet.
std::vector<ClaimLevel> light_levels(const Scene& scene, const ClaimStudyOptions& options);

/// Exception that `advance` may throw to end a study. The study then returns the finished levels of
/// light.
struct StudyInterrupted : std::exception {};

/// Calls `run` with each index below `count`, on all threads. Calls `advance` after each index.
void run_trials(std::size_t count, const std::function<void()>& advance,
                const std::function<void(std::size_t)>& run);

/// One trial for each index below `count`: the return value of `answer`. If `answer` throws, the
/// trial's `error` says why.
template <class Answer>
auto answered_trials(std::size_t count, const std::function<void()>& advance,
                     const Answer& answer) {
  std::vector<decltype(answer(std::size_t{0}))> trials(count);
  run_trials(count, advance, [&](std::size_t i) {
    try {
      trials[i] = answer(i);
    } catch (const std::exception& error) {
      trials[i] = {};
      trials[i].error = error.what();
    }
  });
  return trials;
}

/// Fills each level of light by `fill` and adds it to the study, until a level is interrupted.
template <class Level, class Fill>
void add_levels(const std::vector<ClaimLevel>& lights, StudyScene<Level>& study, const Fill& fill) {
  try {
    for (const ClaimLevel& light : lights) {
      Level level;
      static_cast<ClaimLevel&>(level) = light;
      fill(level);
      study.levels.push_back(std::move(level));
    }
  } catch (const StudyInterrupted&) {  // the study keeps the finished levels
  }
}

/// Number of trials without an answer.
template <class Trial>
int failures_of(const std::vector<Trial>& trials) {
  int failures = 0;
  for (const Trial& trial : trials) failures += trial.error.empty() ? 0 : 1;
  return failures;
}

/// Judges all claims of all scenes together, with 95 % confidence. Returns whether all claims hold.
template <class Level>
bool judge_study(std::vector<StudyScene<Level>>& scenes) {
  std::vector<ClaimTest*> claims;
  for (StudyScene<Level>& scene : scenes) {
    for (Level& level : scene.levels) {
      for (ClaimTest& claim : level.claims) claims.push_back(&claim);
    }
  }
  judge_claims(claims);
  return std::ranges::all_of(claims, [](const ClaimTest* c) { return c->holds; });
}

/// Number of claims, and number of claims that hold.
struct ClaimCount {
  int claims = 0, holding = 0;
};
template <class Level>
ClaimCount count_claims(const std::vector<StudyScene<Level>>& scenes) {
  ClaimCount count;
  for (const StudyScene<Level>& scene : scenes) {
    for (const Level& level : scene.levels) {
      for (const ClaimTest& claim : level.claims) {
        ++count.claims;
        count.holding += claim.holds ? 1 : 0;
      }
    }
  }
  return count;
}

}  // namespace blindcorner
