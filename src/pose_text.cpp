// SPDX-License-Identifier: Apache-2.0
#include "pose_text.h"

#include <cmath>
#include <sstream>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

struct PoseName {
  const char* name;
  Component component;
  double unit;
};
constexpr PoseName kNames[] = {
    {"x_m", Component::x, 1.0},       {"y_m", Component::y, 1.0},
    {"z_m", Component::z, 1.0},       {"yaw_deg", Component::yaw, kDegree},
    {"yaw_rad", Component::yaw, 1.0}, {"size", Component::size, 1.0},
};

}  // namespace

Placement parse_pose(const Scene& scene, const std::string& text) {
  Placement placement = scene.hidden.placement;
  std::stringstream stream(text);
  std::string item;
  while (std::getline(stream, item, ',')) {
    const auto equals = item.find('=');
    const std::string name = item.substr(0, equals);
    const std::string value = equals == std::string::npos ? "" : item.substr(equals + 1);
    const PoseName* known = nullptr;
    for (const PoseName& candidate : kNames) {
      if (name == candidate.name) known = &candidate;
    }
    if (known == nullptr) {
      throw Error("--pose",
                  "found \"" + item +
                      "\", accepted: x_m=, y_m=, z_m=, yaw_deg=, yaw_rad= or size= with a "
                      "number, separated by commas");
    }
    std::size_t used = 0;
    double number = 0;
    try {
      number = std::stod(value, &used);
    } catch (const std::exception&) {
      used = std::string::npos;
    }
    if (used != value.size() || !std::isfinite(number)) {
      throw Error("--pose " + name, "found \"" + value + "\", accepted: a finite number");
    }
    placement.set(known->component, number * known->unit);
  }
  if (!(placement.size > 0)) throw Error("--pose size", "accepted: above 0");
  return placement;
}

std::map<std::string, double> truth_of(const Scene& scene, const Placement& placement) {
  std::map<std::string, double> truth;
  for (const Unknown& unknown : scene.unknowns) {
    truth[component_name(unknown.component)] = placement.get(unknown.component);
  }
  return truth;
}

}  // namespace blindcorner
