// SPDX-License-Identifier: Apache-2.0
#include "io/json_depth.h"

#include "blindcorner/forward/error.h"

namespace blindcorner {

void check_json_depth(std::string_view text, const std::string& where) {
  int depth = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted) {
      if (c == '\\') ++i;  // an escaped character ends no string
      if (c == '"') quoted = false;
    } else if (c == '"') {
      quoted = true;
    } else if (c == '{' || c == '[') {
      if (++depth > kDeepestJson) {
        throw Error(where, "found JSON nested deeper than " + std::to_string(kDeepestJson) +
                               " levels, accepted: at most that");
      }
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
}

}  // namespace blindcorner
