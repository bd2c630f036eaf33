// SPDX-License-Identifier: Apache-2.0
/// Checks of numbers among the arguments. Their messages say what is accepted. Those of CLI11's own
/// checks state the ends of the range, here those of floating point, with 300 digits.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "forward/support/number_range.h"

namespace blindcorner {

inline CLI::Validator number_in(const NumberRange& range, const char* type) {
  return {[range](const std::string& text) -> std::string {
            double value = 0;
            if (CLI::detail::lexical_cast(text, value) && range.contains(value)) return {};
            return "found " + text + ", accepted: " + range.text();
          },
          type};
}

inline CLI::Validator positive_number() { return number_in(NumberRange::above(0), "POSITIVE"); }
inline CLI::Validator number_from_zero() {
  return number_in(NumberRange::at_least(0), "NONNEGATIVE");
}

}  // namespace blindcorner
