// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/claim_tests.h"

#include <gtest/gtest.h>

#include <cmath>

namespace blindcorner {
namespace {

// Of ten fair trials 2 to 8 succeed with 97.9 %, 3 to 7 with 89.1 %.
TEST(BinomialRange, OfTenFairTrials) {
  EXPECT_DOUBLE_EQ(binomial_range(0.5, 10, 0.95).low, 0.2);
  EXPECT_DOUBLE_EQ(binomial_range(0.5, 10, 0.95).high, 0.8);
  EXPECT_DOUBLE_EQ(binomial_range(0.5, 10, 0.85).low, 0.3);
  EXPECT_DOUBLE_EQ(binomial_range(0.5, 10, 0.85).high, 0.7);
  EXPECT_EQ(binomial_range(0.5, 0, 0.95).high, 1);
}

// What lies outside has at most half of the rest on either side, and one more success inside would
// have been too much: checked with the distribution itself.
TEST(BinomialRange, HoldsAsMuchAsItSays) {
  const double p = 0.95;
  const int n = 200;
  const ShareInterval range = binomial_range(p, n, 0.99);
  double below = 0, above = 0;
  for (int k = 0; k <= n; ++k) {
    const double mass =
        std::exp(std::lgamma(n + 1.0) - std::lgamma(k + 1.0) - std::lgamma(n - k + 1.0) +
                 k * std::log(p) + (n - k) * std::log(1 - p));
    if (k < std::lround(range.low * n)) below += mass;
    if (k > std::lround(range.high * n)) above += mass;
  }
  EXPECT_LE(below, 0.005);
  EXPECT_LE(above, 0.005);
  EXPECT_GT(below + above, 0.002);
}

// Clopper and Pearson 1934: 5 of 10, and 0 of 10, whose upper end is 1 - 0.025^(1/10).
TEST(ExactInterval, IsCloppersAndPearsons) {
  EXPECT_NEAR(exact_interval(5, 10).low, 0.1871, 1e-4);
  EXPECT_NEAR(exact_interval(5, 10).high, 0.8129, 1e-4);
  EXPECT_EQ(exact_interval(0, 10).low, 0);
  EXPECT_NEAR(exact_interval(0, 10).high, 1 - std::pow(0.025, 0.1), 1e-9);
  EXPECT_EQ(exact_interval(10, 10).high, 1);
}

// Chi-square with two degrees is exponential.
TEST(ChiSquareRange, OfTwoDegrees) {
  const MeanSquareRange range = chi_square_range(2, 0.95);
  EXPECT_NEAR(range.low, -std::log(0.975), 1e-9);
  EXPECT_NEAR(range.high, -std::log(0.025), 1e-9);
}

// One share within its own range but not, as the narrower range of one test shows, beside others.
TEST(JudgeClaims, AllowsForAllTogether) {
  EXPECT_DOUBLE_EQ(bonferroni(0.95, 1), 0.95);
  EXPECT_DOUBLE_EQ(bonferroni(0.95, 5), 0.99);
  ClaimTest share{"share", ClaimKind::share, 0.5, 0.1, 10};
  ClaimTest square{"square", ClaimKind::mean_square, 1, 3.8, 2};
  std::vector<ClaimTest*> one{&square}, both{&share, &square};
  judge_claims(one);
  EXPECT_FALSE(square.holds);  // above 3.69
  judge_claims(both);
  EXPECT_TRUE(square.holds);  // below 4.38
  EXPECT_FALSE(share.holds);  // one success of ten fair trials or fewer: 1.07 % < 1.25 %
  EXPECT_DOUBLE_EQ(share.low, 0.2);
}

}  // namespace
}  // namespace blindcorner
