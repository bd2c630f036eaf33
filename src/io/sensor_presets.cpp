// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/sensor_presets.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string_view>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace embedded {

/// Text of a preset under src/io/presets, empty when there is none of that name.
std::string_view sensor_preset(std::string_view name);
std::vector<std::string_view> sensor_preset_names();

}  // namespace embedded

std::vector<std::string> sensor_preset_names() {
  std::vector<std::string> names;
  for (const std::string_view name : embedded::sensor_preset_names()) names.emplace_back(name);
  std::ranges::sort(names);
  return names;
}

std::string sensor_preset_text(const std::string& name) {
  const std::string_view text = embedded::sensor_preset(name);
  if (!text.empty()) return std::string(text);
  std::string known;
  for (const std::string& other : sensor_preset_names()) {
    known += (known.empty() ? "" : ", ") + other;
  }
  throw Error("preset", "found \"" + name + "\", accepted: " + known);
}

double sensor_preset_scale(const std::string& name) {
  constexpr double kLongRange = 20;  // m
  const auto sensor = nlohmann::json::parse(sensor_preset_text(name));
  const double path = sensor.at("bins").get<double>() * sensor.at("bin_width_ps").get<double>() *
                      1e-12 * kSpeedOfLight;
  return path > kLongRange ? 10 : 1;
}

}  // namespace blindcorner
