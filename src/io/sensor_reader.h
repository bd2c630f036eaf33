// SPDX-License-Identifier: Apache-2.0
/// The `sensor` part of a scene file, and the presets that it may start from.
#pragma once

#include "blindcorner/forward/sensor/sensor.h"
#include "io/json_reader.h"

namespace blindcorner {

/// Reads a sensor: explicit, or a preset with overrides. Throws Error.
Sensor read_sensor(const JsonReader& reader);

/// A sensor's `noise` as a scene file states it.
nlohmann::ordered_json noise_json(const Sensor& sensor);

}  // namespace blindcorner
