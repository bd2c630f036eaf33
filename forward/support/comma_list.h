// SPDX-License-Identifier: Apache-2.0
/// Lists of names in messages.
#pragma once

#include <string>
#include <vector>

namespace blindcorner {

/// Joins names with commas: "x_m, y_m, yaw_rad".
inline std::string comma_list(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

}  // namespace blindcorner
