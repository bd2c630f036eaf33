// SPDX-License-Identifier: Apache-2.0
/// printf into a string, for tables and pages.
#pragma once

#include <string>

namespace blindcorner {

/// Like std::printf, into a string of any length. The compiler checks the arguments against the
/// pattern.
[[gnu::format(printf, 1, 2)]] std::string formatted(const char* pattern, ...);

}  // namespace blindcorner
