// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/paired_difference.h"

#include <algorithm>
#include <cmath>

#include "blindcorner/simulation/credible_level.h"

namespace blindcorner {
namespace {

/// Correlation of the two outcomes. A positive one is lowered for continuity. 0 if one outcome
/// never changes.
double correlation(const PairedCounts& c) {
  const double a = c.both, b = c.only_first, d = c.only_second, e = c.neither;
  const double product = (a + b) * (d + e) * (a + d) * (b + e);
  if (product <= 0) return 0;
  double numerator = a * e - b * d;
  if (numerator > 0) numerator = std::max(0.0, numerator - c.trials() / 2.0);
  return numerator / std::sqrt(product);
}

}  // namespace

PairedDifference paired_difference(const PairedCounts& counts) {
  const int n = counts.trials();
  if (n == 0) return {};
  const int first = counts.both + counts.only_first, second = counts.both + counts.only_second;
  const double p = static_cast<double>(first) / n, q = static_cast<double>(second) / n;
  const ShareInterval of_p = wilson_interval(first, n), of_q = wilson_interval(second, n);
  const double phi = correlation(counts);
  const auto joined = [&](double a, double b) {
    return std::sqrt(std::max(0.0, a * a - 2 * phi * a * b + b * b));
  };
  const double difference = p - q;
  // Rounding must not lead beyond what shares can differ by.
  return {difference, std::max(-1.0, difference - joined(p - of_p.low, of_q.high - q)),
          std::min(1.0, difference + joined(of_p.high - p, q - of_q.low))};
}

}  // namespace blindcorner
