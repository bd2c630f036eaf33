// SPDX-License-Identifier: Apache-2.0
#include "planner/require_positive.h"

#include <cmath>
#include <string>

#include "blindcorner/forward/error.h"

namespace blindcorner {

void require_positive(const char* owner, const char* field, double value) {
  if (value > 0 && std::isfinite(value)) return;
  throw Error(std::string(owner) + "." + field + " = " + std::to_string(value) +
              "; accepted: a number > 0");
}

}  // namespace blindcorner
