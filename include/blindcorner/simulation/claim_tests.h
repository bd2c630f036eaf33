// SPDX-License-Identifier: Apache-2.0
/// Exact tests of claims: how far a share or a mean square may be from what was claimed.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "blindcorner/simulation/credible_level.h"

namespace blindcorner {

/// Confidence of each of so many tests with which all of them hold together with `family`:
/// Bonferroni's, which needs no independence.
double bonferroni(double family, int tests);

/// The shares of `trials` within which the observed one lies with at least this confidence when
/// each trial succeeds with `probability`: equal tails of the binomial distribution, ends included.
ShareInterval binomial_range(double probability, int trials, double confidence);

/// Interval of a share that was found (Clopper and Pearson 1934): it holds the true one with at
/// least this confidence. All of 0 to 1 without trials.
ShareInterval exact_interval(int successes, int trials, double confidence = 0.95);

/// Range of the mean of so many squared standard normal deviates, equal tails.
struct MeanSquareRange {
  double low = 0, high = 0;
};
MeanSquareRange chi_square_range(int degrees, double confidence);

enum class ClaimKind {
  share,       ///< of trials, each with the claimed probability
  mean_square  ///< of standard normal deviates: 1
};

/// One claim beside what was found, and what it may be where the claim is true.
struct ClaimTest {
  std::string what;
  ClaimKind kind = ClaimKind::share;
  double claimed = 0, found = 0;
  int trials = 0;            ///< of a mean square, the deviates
  double low = 0, high = 0;  ///< allowed
  bool holds = false;
};

/// Fills in what is allowed, so that all claims together, when true, hold with `family`.
void judge_claims(std::span<ClaimTest*> tests, double family = 0.95);

}  // namespace blindcorner
