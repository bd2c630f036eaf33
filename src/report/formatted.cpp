// SPDX-License-Identifier: Apache-2.0
#include "report/formatted.h"

#include <cstdarg>
#include <cstdio>

namespace blindcorner {

std::string formatted(const char* pattern, ...) {
  std::va_list arguments;
  va_start(arguments, pattern);
  std::va_list again;
  va_copy(again, arguments);
  const int length = std::vsnprintf(nullptr, 0, pattern, arguments);
  va_end(arguments);
  std::string text(static_cast<std::size_t>(length > 0 ? length : 0), '\0');
  // The terminating zero goes where the string keeps its own.
  std::vsnprintf(text.data(), text.size() + 1, pattern, again);
  va_end(again);
  return text;
}

}  // namespace blindcorner
