// SPDX-License-Identifier: Apache-2.0
/// A scene file to begin with: a box on a desk, which a partition hides from the sensor.
#pragma once

#include <string>

namespace blindcorner {

/// Text of the scene for a preset's sensor, complete and ready to be fitted. A sensor that records
/// paths of more than 20 m gets a yard ten times as large. Throws Error that lists the presets.
std::string starter_scene(const std::string& preset);

}  // namespace blindcorner
