// SPDX-License-Identifier: Apache-2.0
/// Sentences for whoever waits.
#pragma once

#include <cstdio>
#include <string>

namespace blindcorner {

/// Says on standard error what now takes a while, at once and whether or not that is a terminal.
inline void tell_begun(const std::string& doing) {
  std::fprintf(stderr, "blindcorner: %s\n", doing.c_str());
  std::fflush(stderr);
}

}  // namespace blindcorner
