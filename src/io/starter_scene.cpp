// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/starter_scene.h"

#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "blindcorner/io/sensor_presets.h"

namespace blindcorner {
namespace {

/// Lengths, m, are numbers after $: they grow with the sensor's range.
constexpr std::string_view kTemplate = R"({
  "$schema": "scene.schema.json",
  "description": "A sensor on a desk looks at a wall; a partition hides a box that stands on the desk. Put in your own numbers.",
  "sensor": {"preset": "@"},
  "sensor_pose": {"position_m": [0, 0, $0.3], "look": [1, 0.1, 0]},
  "surfaces": [
    {
      "name": "wall", "shape": "rectangle", "center_m": [$0.6, 0, $0.5], "normal": [-1, 0, 0],
      "width_m": $2, "height_m": $1, "albedo": 0.7, "relay": true
    },
    {
      "name": "desk", "shape": "rectangle", "center_m": [0, 0, 0], "normal": [0, 0, 1],
      "width_m": $2, "height_m": $2, "albedo": 0.4
    },
    {
      "name": "partition", "shape": "box", "base_m": [0, $0.25, 0], "size_m": [$0.6, $0.02, $0.6],
      "albedo": 0.05, "occluder": true
    }
  ],
  "hidden": {
    "name": "box", "shape": "box", "size_m": [$0.1, $0.2, $0.15], "albedo": 0.8,
    "position_m": [null, null, 0]
  },
  "unknowns": {
    "x_m": [$0.05, $0.4],
    "y_m": [$0.4, $0.9],
    "yaw_deg": [-90, 90]
  },
  "linear": {
    "amplitude": {"mode": "shared", "prior": {"median": 1, "sigma_log": 1}},
    "ambient": {"mode": "per_zone"},
    "direct": {"mode": "per_zone"}
  }
}
)";

}  // namespace

std::string starter_scene(const std::string& preset) {
  const double scale = sensor_preset_scale(preset);
  const std::string pattern(kTemplate);
  std::string text;
  for (std::size_t i = 0; i < pattern.size(); ++i) {
    if (pattern[i] == '@') {
      text += preset;
    } else if (pattern[i] == '$' && pattern[i + 1] != 's') {  // not "$schema"
      char* end = nullptr;
      char number[32];
      std::snprintf(number, sizeof number, "%.6g", scale * std::strtod(&pattern[i + 1], &end));
      text += number;
      i = static_cast<std::size_t>(end - pattern.data()) - 1;
    } else {
      text += pattern[i];
    }
  }
  return text;
}

}  // namespace blindcorner
