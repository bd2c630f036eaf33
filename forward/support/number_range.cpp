// SPDX-License-Identifier: Apache-2.0
#include "forward/support/number_range.h"

#include <cmath>
#include <cstdio>

namespace blindcorner {

std::string number_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.10g", value);
  return text;
}

bool NumberRange::contains(double value) const {
  return std::isfinite(value) && (above_lower ? value > lower : value >= lower) &&
         (below_upper ? value < upper : value <= upper);
}

std::string NumberRange::text(const char* noun) const {
  const bool low = std::isfinite(lower);
  const bool high = std::isfinite(upper);
  if (low && high && !above_lower && !below_upper) {
    return std::string(noun) + " from " + number_text(lower) + " to " + number_text(upper);
  }
  std::string text = noun;
  if (low) text += (above_lower ? " > " : " >= ") + number_text(lower);
  if (low && high) text += " and";
  if (high) text += (below_upper ? " < " : " <= ") + number_text(upper);
  return text;
}

}  // namespace blindcorner
