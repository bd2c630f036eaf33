// SPDX-License-Identifier: Apache-2.0
/// Ranges of numbers and how messages state them.
#pragma once

#include <limits>
#include <string>

namespace blindcorner {

/// Numbers that a field accepts. `lower` and `upper` are accepted unless the flags exclude them.
struct NumberRange {
  double lower = -std::numeric_limits<double>::infinity();
  double upper = std::numeric_limits<double>::infinity();
  bool above_lower = false;  ///< `lower` itself is not accepted
  bool below_upper = false;  ///< `upper` itself is not accepted

  static NumberRange above(double lower) { return {.lower = lower, .above_lower = true}; }
  static NumberRange at_least(double lower) { return {.lower = lower}; }
  static NumberRange between(double lower, double upper) {
    return {.lower = lower, .upper = upper};
  }
  /// Neither end is accepted.
  static NumberRange inside(double lower, double upper) {
    return {.lower = lower, .upper = upper, .above_lower = true, .below_upper = true};
  }

  bool contains(double value) const;
  /// "a number > 0", "a number from 0 to 1", ...
  std::string text(const char* noun = "a number") const;
};

/// A number as messages show it.
std::string number_text(double value);

}  // namespace blindcorner
