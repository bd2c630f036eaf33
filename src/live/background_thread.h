// SPDX-License-Identifier: Apache-2.0
/// Threads that have to leave the processor to the fit.
#pragma once

#include <sys/resource.h>

namespace blindcorner::live {

/// Lets all other threads of the program go before the calling thread. On Linux a nice value
/// belongs to a thread. If the system does not allow the change, nothing happens.
inline void give_way() {
  constexpr int kNice = 10;
  [[maybe_unused]] const int unimportant = ::setpriority(PRIO_PROCESS, 0, kNice);
}

}  // namespace blindcorner::live
