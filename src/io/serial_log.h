// SPDX-License-Identifier: Apache-2.0
/// Logs of serial ports as terminal programs store them.
#pragma once

#include <algorithm>
#include <string_view>

namespace blindcorner {

/// The line without the times that many serial monitors put before it: "12:34:56.789 -> D",
/// "[2026-01-31 12:34:56] D", "2026-01-31T12:34:56<TAB>D". Other lines stay as they are.
inline std::string_view without_time_stamp(std::string_view line) {
  const auto is_stamp = [](std::string_view word) {
    const auto count = [&](char c) { return std::ranges::count(word, c); };
    const bool dated = count('-') == 2 || count('/') == 2 || count('.') == 2;
    return word.find_first_of("0123456789") != std::string_view::npos &&
           word.find_first_not_of("0123456789:.,-/[]TZ+") == std::string_view::npos &&
           (count(':') > 0 || dated);
  };
  const auto is_mark = [](std::string_view word) {
    return word == "->" || word == ">" || word == "|" || word == "-" || word == "]";
  };
  std::string_view rest = line;
  bool stamped = false;
  for (;;) {
    rest.remove_prefix(std::min(rest.find_first_not_of(" \t"), rest.size()));
    const std::string_view word = rest.substr(0, rest.find_first_of(" \t"));
    if (!is_stamp(word) && !(stamped && is_mark(word))) return stamped ? rest : line;
    stamped = true;
    rest.remove_prefix(word.size());
  }
}

}  // namespace blindcorner
