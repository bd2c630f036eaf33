// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/claim_tests.h"

#include <boost/math/distributions/beta.hpp>
#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/chi_squared.hpp>

namespace blindcorner {

double bonferroni(double family, int tests) {
  return tests > 1 ? 1 - (1 - family) / tests : family;
}

ShareInterval binomial_range(double probability, int trials, double confidence) {
  if (trials <= 0) return {};
  // The smallest numbers of successes that are not exceeded with at least the probabilities `tail`
  // and 1 - `tail`. Fewer than the first, or more than the second, have a probability of at most
  // `tail` each.
  using namespace boost::math::policies;
  using RoundedUp = policy<discrete_quantile<integer_round_up>>;
  const boost::math::binomial_distribution<double, RoundedUp> law(trials, probability);
  const double tail = (1 - confidence) / 2;
  return {boost::math::quantile(law, tail) / trials, boost::math::quantile(law, 1 - tail) / trials};
}

ShareInterval exact_interval(int successes, int trials, double confidence) {
  if (trials <= 0) return {};
  const double tail = (1 - confidence) / 2, k = successes, n = trials;
  ShareInterval interval;
  if (successes > 0) {
    interval.low =
        boost::math::quantile(boost::math::beta_distribution<double>(k, n - k + 1), tail);
  }
  if (successes < trials) {
    interval.high =
        boost::math::quantile(boost::math::beta_distribution<double>(k + 1, n - k), 1 - tail);
  }
  return interval;
}

MeanSquareRange chi_square_range(int degrees, double confidence) {
  if (degrees <= 0) return {};
  const boost::math::chi_squared_distribution<double> law(degrees);
  const double tail = (1 - confidence) / 2;
  return {boost::math::quantile(law, tail) / degrees,
          boost::math::quantile(boost::math::complement(law, tail)) / degrees};
}

void judge_claims(std::span<ClaimTest*> tests, double family) {
  const double confidence = bonferroni(family, static_cast<int>(tests.size()));
  for (ClaimTest* test : tests) {
    if (test->kind == ClaimKind::share) {
      const ShareInterval range = binomial_range(test->claimed, test->trials, confidence);
      test->low = range.low;
      test->high = range.high;
    } else {
      const MeanSquareRange range = chi_square_range(test->trials, confidence);
      test->low = range.low;
      test->high = range.high;
    }
    // Shares are whole numbers of trials; rounding must not decide.
    const double rounding = 1e-9;
    test->holds = test->found >= test->low - rounding && test->found <= test->high + rounding;
  }
}

}  // namespace blindcorner
