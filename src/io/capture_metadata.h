// SPDX-License-Identifier: Apache-2.0
/// What the readers of captures share beside the metadata's text.
#pragma once

#include <string>

#include "blindcorner/io/capture_metadata.h"

namespace blindcorner {

/// Whether a name is that of an unknown: "x_m", "front.yaw_rad".
bool is_component(const std::string& name);

}  // namespace blindcorner
