// SPDX-License-Identifier: Apache-2.0
/// Threads that have to leave the processor to the fit.
#pragma once

#include <sys/resource.h>

namespace blindcorner::live {

/// The calling thread gives way to all others of the program. On Linux a nice value belongs to a
/// thread; where that is not allowed, nothing happens.
inline void give_way() {
  constexpr int kNice = 10;
  [[maybe_unused]] const int unimportant = ::setpriority(PRIO_PROCESS, 0, kNice);
}

}  // namespace blindcorner::live
