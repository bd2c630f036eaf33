// SPDX-License-Identifier: Apache-2.0
/// Angles for readers: files hold radians, readers want degrees.
#pragma once

#include <string>

#include "blindcorner/forward/constants.h"

namespace blindcorner {

/// Factor from a value of this name to what readers see: "yaw_rad" becomes degrees.
inline double reading_unit(const std::string& name) {
  return name.ends_with("_rad") ? 1 / kDegree : 1.0;
}

/// The name with the unit that is shown: "yaw_deg".
inline std::string reading_name(const std::string& name) {
  return name.ends_with("_rad") ? name.substr(0, name.size() - 3) + "deg" : name;
}

}  // namespace blindcorner
