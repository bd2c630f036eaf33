// SPDX-License-Identifier: Apache-2.0
/// Is there an object at all?
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <utility>

#include "inverse/search/scoring.h"

namespace blindcorner {

/// Probability of presence from the evidences with and without an object.
double presence_probability(double log_evidence_present, double log_evidence_empty, double prior);

/// Distribution of the largest score over all poses in empty captures: a Gumbel law fitted to
/// simulated ones, because the best of many poses follows no textbook chi-square.
struct EmptyScores {
  double location = 0;
  double scale = 1;

  /// Share of empty captures that score at least this much.
  double exceedance(double score) const;
};

/// Keeps one distribution per light level, shared by captures. Thread safe.
class FalseAlarmCalibration {
 public:
  /// Probability that an empty capture like this one scores at least as high as this one does.
  double probability(const PoseObjective& objective, const LinearSolution& empty, int captures,
                     std::uint64_t seed);

 private:
  static EmptyScores simulate(const PoseObjective& objective, LinearSolution typical, double level,
                              int captures, std::uint64_t seed);

  std::mutex mutex_;
  std::map<std::pair<int, int>, EmptyScores> known_;  // by octaves of light level and exposures
};

}  // namespace blindcorner
