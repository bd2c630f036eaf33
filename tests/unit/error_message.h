// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

#include "blindcorner/forward/error.h"

namespace blindcorner {

/// What the Error says that an action throws; "no error" where it throws none.
inline std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace blindcorner
