// SPDX-License-Identifier: Apache-2.0
/// Whether what is said to happen with probability p happens in a share p of the trials.
#pragma once

#include <vector>

#include "blindcorner/simulation/credible_level.h"

namespace blindcorner {

/// Statements whose probability lies in [lower, upper).
struct ReliabilityBin {
  double lower = 0, upper = 1;
  int statements = 0;
  int happened = 0;
  double mean_predicted = 0;  ///< of the statements; 0 without any
  double observed = 0;        ///< share that happened; 0 without any
  /// Wilson's 95 % interval of the share, for independent statements. Cells of one trial are not
  /// independent: take one cell of each, or `effective_trials` below.
  ShareInterval interval;
};

/// What is counted of one bin.
struct ReliabilityCount {
  int statements = 0, happened = 0;
  double sum = 0;  ///< of the probabilities
};

/// Counts probabilities and outcomes (DeGroot & Fienberg 1983).
class ReliabilityDiagram {
 public:
  /// Bins of equal width over 0..1. Throws Error for less than one.
  explicit ReliabilityDiagram(int bins = 10);
  /// As counts() has given it, [bins]. Throws Error for less than one.
  explicit ReliabilityDiagram(std::vector<ReliabilityCount> counts);

  /// Throws Error when the probability is none.
  void add(double probability, bool happened);
  /// Adds the statements of another diagram with as many bins (of other trials, other threads).
  void merge(const ReliabilityDiagram& other);

  /// From the lowest. With `effective_trials`, no interval is narrower than so many independent
  /// statements allow.
  std::vector<ReliabilityBin> bins(int effective_trials = 0) const;
  /// The same with a number of its own for each bin, [bins].
  std::vector<ReliabilityBin> bins(const std::vector<int>& effective_trials) const;
  /// [bins] For files.
  const std::vector<ReliabilityCount>& counts() const { return counts_; }

 private:
  std::vector<ReliabilityCount> counts_;
};

}  // namespace blindcorner
