// SPDX-License-Identifier: Apache-2.0
/// Sentences for users who wait.
#pragma once

#include <cstdio>
#include <string>

namespace blindcorner {

/// Says on standard error what begins and takes a while. It does so at once, even if standard error
/// is not a terminal.
inline void tell_begun(const std::string& doing) {
  std::fprintf(stderr, "blindcorner: %s\n", doing.c_str());
  std::fflush(stderr);
}

}  // namespace blindcorner
