// SPDX-License-Identifier: Apache-2.0
/// A scene file to start with: a box on a desk, hidden from the sensor by a partition.
#pragma once

#include <string>

namespace blindcorner {

/// Text of the scene for a preset's sensor, complete and ready for a fit. A sensor that records
/// paths of more than 20 m gets a yard ten times as large. Throws Error that lists the presets.
std::string starter_scene(const std::string& preset);

}  // namespace blindcorner
