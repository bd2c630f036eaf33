// SPDX-License-Identifier: Apache-2.0
/// The frame of studies of what fits claim: captures of objects that come from a scene's priors, at
/// levels of light, and claims that are judged all together.
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
  int captures = 200;  ///< with an object, of each scene and level of light, the model right
  /// Photons of the third bounce on average over the search region, as exposure_for(); empty: the
  /// scene's own exposure.
  std::vector<double> photons;
  TrueLight light = TrueLight::reference;
  double sampling = 1.0;  ///< of the reference renderer, as DrawOptions::sampling
  FitOptions fit;
  std::uint64_t seed = 1;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// One level of light of a scene, and what is claimed at it.
struct ClaimLevel {
  std::optional<double> photons;  ///< empty: the scene's own exposure
  Exposure exposure;
  std::uint64_t seed = 0;  ///< of its captures, far from those of other levels
  std::vector<ClaimTest> claims;
  int failures = 0;  ///< captures without an answer
};

/// What the truth's own sampling may add to the mean squared normalised error: as much as 2000
/// captures of two unknowns tell.
inline constexpr double kMaxTruthError = 0.05;

/// One scene; `Level` is a ClaimLevel with what the study keeps of it.
template <class Level>
struct StudyScene {
  Scene scene;
  std::vector<Level> levels;
};

/// What a study ran with and found.
template <class Options, class Level>
struct StudyReport {
  Options options;
  std::vector<StudyScene<Level>> scenes;  ///< judged
};

/// How a study's objects are drawn.
DrawOptions draw_options(const ClaimStudyOptions& options);

/// The levels of light that are asked for, with nothing claimed yet.
std::vector<ClaimLevel> light_levels(const Scene& scene, const ClaimStudyOptions& options);

/// What `advance` may throw to end a study: it returns the levels of light that are finished.
struct StudyInterrupted : std::exception {};

/// Calls `run` with each place below `count`, on all threads, and `advance` after each.
void run_trials(std::size_t count, const std::function<void()>& advance,
                const std::function<void(std::size_t)>& run);

/// A trial for each place below `count`: what `answer` returns, or, where it throws, one whose
/// `error` says why.
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

/// Fills each level of light by `fill` and adds it to the study, until one is interrupted.
template <class Level, class Fill>
void add_levels(const std::vector<ClaimLevel>& lights, StudyScene<Level>& study, const Fill& fill) {
  try {
    for (const ClaimLevel& light : lights) {
      Level level;
      static_cast<ClaimLevel&>(level) = light;
      fill(level);
      study.levels.push_back(std::move(level));
    }
  } catch (const StudyInterrupted&) {  // with what is finished
  }
}

/// Trials without an answer.
template <class Trial>
int failures_of(const std::vector<Trial>& trials) {
  int failures = 0;
  for (const Trial& trial : trials) failures += trial.error.empty() ? 0 : 1;
  return failures;
}

/// Judges all claims of all scenes together, with 95 %. Returns whether all hold.
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

/// How many claims hold.
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
