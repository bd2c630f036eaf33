// SPDX-License-Identifier: Apache-2.0
/// printf into a string, for tables and pages.
#pragma once

#include <string>

namespace blindcorner {

/// As std::printf, of any length; the compiler checks the arguments against the pattern.
[[gnu::format(printf, 1, 2)]] std::string formatted(const char* pattern, ...);

}  // namespace blindcorner
