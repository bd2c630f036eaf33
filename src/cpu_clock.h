// SPDX-License-Identifier: Apache-2.0
/// Run times that other programs on the machine do not lengthen.
#pragma once

#include <algorithm>
#include <ctime>
#include <vector>

namespace blindcorner {

/// Processor time of the calling thread, s.
inline double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Median; of an even number the upper one. 0 of nothing.
inline double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace blindcorner
