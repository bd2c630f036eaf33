// SPDX-License-Identifier: Apache-2.0
/// Exact tests of claims: how far a found share or mean square may be from the claimed value.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "blindcorner/simulation/credible_level.h"

namespace blindcorner {

/// Confidence that each of `tests` tests needs so that all of them together hold with confidence
/// `family`. This is Bonferroni's rule, which needs no independence.
double bonferroni(double family, int tests);

/// Range of shares that holds the observed share with at least this confidence, when each of
/// `trials` trials succeeds with `probability`. The tails of the binomial distribution are equal;
/// the ends are included.
ShareInterval binomial_range(double probability, int trials, double confidence);

/// Interval of a found share (Clopper and Pearson 1934). It holds the true share with at least this
/// confidence. Without trials, it is 0 to 1.
ShareInterval exact_interval(int successes, int trials, double confidence = 0.95);

/// Range of the mean of `degrees` squared standard normal deviates, with equal tails.
struct MeanSquareRange {
  double low = 0, high = 0;
};
MeanSquareRange chi_square_range(int degrees, double confidence);

enum class ClaimKind {
  share,       ///< share of trials, each with the claimed probability
  mean_square  ///< mean square of standard normal deviates; 1 is claimed
};

/// One claim, the value found, and the range that is allowed if the claim is true.
struct ClaimTest {
  std::string what;
  ClaimKind kind = ClaimKind::share;
  double claimed = 0, found = 0;
  int trials = 0;            ///< for a mean square, the number of deviates
  double low = 0, high = 0;  ///< allowed range
  bool holds = false;
};

/// Fills in the allowed ranges and whether each claim holds. If all claims are true, all of them
/// together hold with confidence `family`.
void judge_claims(std::span<ClaimTest*> tests, double family = 0.95);

}  // namespace blindcorner
