// SPDX-License-Identifier: Apache-2.0
/// Sensors that the library knows by name (docs/scene.md).
#pragma once

#include <string>
#include <vector>

namespace blindcorner {

/// Names that a scene file's `sensor.preset` accepts, sorted.
std::vector<std::string> sensor_preset_names();

/// JSON of the fields that a preset stands for. Throws Error that lists the names.
std::string sensor_preset_text(const std::string& name);

}  // namespace blindcorner
