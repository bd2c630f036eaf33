// SPDX-License-Identifier: Apache-2.0
/// Order statistics of samples.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace blindcorner {

/// The value below which the share `share` (0 to 1) of the values lies. It is linear between order
/// statistics, and 0 if there are no values.
inline double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const double place = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::ptrdiff_t>(place);
  const auto at = values.begin() + below;
  std::nth_element(values.begin(), at, values.end());
  if (at + 1 == values.end()) return *at;
  const double next = *std::min_element(at + 1, values.end());
  return *at + (place - static_cast<double>(below)) * (next - *at);
}

inline double median(std::vector<double> values) { return quantile(std::move(values), 0.5); }

}  // namespace blindcorner
