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

/// What lengths of a scene for a preset's sensor are multiplied with: 1 for those that look a few
/// metres far, 10 for those that record paths of more than 20 m.
double sensor_preset_scale(const std::string& name);

}  // namespace blindcorner
