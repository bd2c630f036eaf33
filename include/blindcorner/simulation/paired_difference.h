// SPDX-License-Identifier: Apache-2.0
/// Differences of shares that were found on the same trials.
#pragma once

namespace blindcorner {

/// Outcomes of two methods on the same trials.
struct PairedCounts {
  int both = 0;         ///< trials in which both succeeded
  int only_first = 0;   ///< trials in which only the first succeeded
  int only_second = 0;  ///< trials in which only the second succeeded
  int neither = 0;

  int trials() const { return both + only_first + only_second + neither; }
};

/// Share of the first method minus share of the second, with its 95 % interval.
struct PairedDifference {
  double value = 0;
  double low = -1, high = 1;  ///< -1 to 1 without trials
};

/// Newcombe 1998, Statistics in Medicine 17, 2635, method 10: Wilson's intervals of both shares,
/// joined by the correlation of the outcomes. The interval also holds for few trials and for shares
/// of 0 and 1.
PairedDifference paired_difference(const PairedCounts& counts);

}  // namespace blindcorner
