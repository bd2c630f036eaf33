// SPDX-License-Identifier: Apache-2.0
/// Tests whether events stated with probability p happen in a share p of the trials.
#pragma once

#include <vector>

#include "blindcorner/simulation/credible_level.h"

namespace blindcorner {

/// Statements whose probability lies in [lower, upper). The last bin includes 1.
struct ReliabilityBin {
  double lower = 0, upper = 1;
  int statements = 0;
  int happened = 0;
  double mean_predicted = 0;  ///< mean probability of the statements; 0 without statements
  double observed = 0;        ///< share of statements that happened; 0 without statements
  /// Wilson's 95 % interval of the share, for independent statements. Cells of one trial are not
  /// independent: use one cell of each trial, or `effective_trials` below.
  ShareInterval interval;
};

/// Counts of one bin.
struct ReliabilityCount {
  int statements = 0, happened = 0;
  double sum = 0;  ///< sum of the probabilities
};

/// Counts probabilities and outcomes (DeGroot & Fienberg 1983).
class ReliabilityDiagram {
 public:
  /// Bins of equal width over 0..1. Throws Error for less than one bin.
  explicit ReliabilityDiagram(int bins = 10);
  /// Starts from the result of counts(), [bins]. Throws Error for less than one bin.
  explicit ReliabilityDiagram(std::vector<ReliabilityCount> counts);

  /// Throws Error unless the probability is from 0 to 1.
  void add(double probability, bool happened);
  /// Adds the statements of another diagram (of other trials or other threads). Throws Error unless
  /// it has as many bins.
  void merge(const ReliabilityDiagram& other);

  /// Bins from the lowest. With `effective_trials`, no interval is narrower than so many
  /// independent statements allow.
  std::vector<ReliabilityBin> bins(int effective_trials = 0) const;
  /// The same with a separate number of effective trials for each bin, [bins].
  std::vector<ReliabilityBin> bins(const std::vector<int>& effective_trials) const;
  /// [bins] Counts, for files.
  const std::vector<ReliabilityCount>& counts() const { return counts_; }

 private:
  std::vector<ReliabilityCount> counts_;
};

}  // namespace blindcorner
