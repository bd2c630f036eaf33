// SPDX-License-Identifier: Apache-2.0
/// Logs of serial ports as terminal programs store them.
#pragma once

#include <string_view>

namespace blindcorner {

/// The line without the time that many serial monitors put before it: "12:34:56.789 -> #Raw,...",
/// "[2026-01-31 12:34:56] #Raw,...", "12:34:56.789 > #Raw,...". A line without one as it is.
inline std::string_view without_time_stamp(std::string_view line) {
  for (const std::string_view end : {" -> ", "] ", " > "}) {
    const std::size_t at = line.find(end);
    if (at == std::string_view::npos) continue;
    const std::string_view stamp = line.substr(0, at);
    const bool time = stamp.find(':') != std::string_view::npos &&
                      stamp.find_first_not_of("0123456789:.,-/[ T") == std::string_view::npos;
    if (time) return line.substr(at + end.size());
  }
  return line;
}

}  // namespace blindcorner
