// SPDX-License-Identifier: Apache-2.0
/// Is there an object at all?
#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <mutex>
#include <vector>

#include "inverse/search/scoring.h"

namespace blindcorner {

/// Largest false-alarm probability at which an object counts as detected, by convention.
inline constexpr double kAlarm = 0.05;

/// Probability of presence from the evidences with and without an object.
double presence_probability(double log_evidence_present, double log_evidence_empty, double prior);

/// Distribution of the largest score over all poses in empty captures: a Gumbel law fitted to
/// simulated captures, because the best of many poses follows no textbook chi-square.
struct EmptyScores {
  double location = 0;
  double scale = 1;

  /// Share of empty captures that score at least this much.
  double exceedance(double score) const;
  /// The score that this share of empty captures exceeds, in (0, 1).
  double exceeded_by(double share) const;
};

/// What the distribution depends on beside the compiled scene. The simulation uses exactly these
/// levels, and a static background as bright as the scene says, so that it does not matter which
/// capture asks first.
struct EmptyLevel {
  int ambient = 0;    ///< log2 of the ratio of a bin's mean ambient light to the light that equals
                      ///< its own standard deviation (one photon where photons are counted)
  int exposures = 0;  ///< log2 of the most exposures of a zone, over the dispersion
  /// [captures * zones] log2 of the ratio of each zone's exposures to the most; empty: all alike.
  std::vector<int> share;

  auto operator<=>(const EmptyLevel&) const = default;
};

/// The level of a capture whose fit without an object is `empty`.
EmptyLevel empty_level(const PoseObjective& objective, const LinearSolution& empty);

/// Simulates `captures` empty captures of the scene.
EmptyScores simulate_empty(const CompiledScene& compiled, const EmptyLevel& level, int captures,
                           std::uint64_t seed);

/// Keeps one distribution per level of light, shared by captures. Thread safe; answers depend
/// neither on the order of captures nor on the number of threads.
class FalseAlarmCalibration {
 public:
  /// Distributions are simulated in the scene `home`, which must outlive this object. If `home` is
  /// null, they are simulated in the scene of the objective that asks, which must then be the same
  /// for all objectives.
  explicit FalseAlarmCalibration(const CompiledScene* home = nullptr) : home_(home) {}

  /// Probability that an empty capture like this one scores at least as high as this one does.
  double probability(const PoseObjective& objective, const LinearSolution& empty, int captures,
                     std::uint64_t seed);

 private:
  const CompiledScene* home_;
  std::mutex mutex_;
  std::map<EmptyLevel, EmptyScores> known_;
};

}  // namespace blindcorner
