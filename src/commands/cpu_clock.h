// SPDX-License-Identifier: Apache-2.0
/// Run times that other programs on the machine do not lengthen.
#pragma once

#include <ctime>

namespace blindcorner {

/// Processor time of the calling thread, s.
inline double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace blindcorner
