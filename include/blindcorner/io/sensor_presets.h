// SPDX-License-Identifier: Apache-2.0
/// Sensors that the library knows by name (docs/scene.md).
#pragma once

#include <string>
#include <vector>

namespace blindcorner {

/// Names that a scene file's `sensor.preset` accepts, sorted.
std::vector<std::string> sensor_preset_names();

/// JSON of the fields that a preset stands for. Throws Error that lists the names of the presets.
std::string sensor_preset_text(const std::string& name);

/// Factor for the lengths of a scene for a preset's sensor: 1 for sensors with a range of a few
/// metres, 10 for sensors that record paths of more than 20 m.
double sensor_preset_scale(const std::string& name);

}  // namespace blindcorner
