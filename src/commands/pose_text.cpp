// SPDX-License-Identifier: Apache-2.0
#include "commands/pose_text.h"

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

/// Takes "front." off the front of a name; the index of that object, -1 for none of that name.
int take_object(const Scene& scene, std::string& name) {
  const auto dot = name.find('.');
  if (dot == std::string::npos) return object_count(scene) == 1 ? 0 : -1;
  const std::string object = name.substr(0, dot);
  for (int i = 0; i < object_count(scene); ++i) {
    if (hidden_object(scene, i).name != object) continue;
    name = name.substr(dot + 1);
    return i;
  }
  return -1;
}

std::string accepted_names(const Scene& scene) {
  std::string text = "x_m=, y_m=, z_m=, yaw_deg=, yaw_rad= or size= with a number, ";
  if (object_count(scene) > 1) {
    text += "each after an object's name";
    for (int i = 0; i < object_count(scene); ++i) {
      text += (i == 0 ? " (" : ", ") + hidden_object(scene, i).name + ".";
    }
    text += "), ";
  }
  return text + "separated by commas";
}

}  // namespace

std::vector<Placement> parse_pose(const Scene& scene, const std::string& text) {
  std::vector<Placement> placements = stated_placements(scene);
  std::stringstream stream(text);
  std::string item;
  while (std::getline(stream, item, ',')) {
    const auto equals = item.find('=');
    std::string name = item.substr(0, equals);
    const std::string value = equals == std::string::npos ? "" : item.substr(equals + 1);
    const std::string full_name = name;
    const int object = take_object(scene, name);
    const PoseName* known = nullptr;
    for (const PoseName& candidate : kNames) {
      if (name == candidate.name) known = &candidate;
    }
    if (known == nullptr || object < 0) {
      throw Error("--pose", "found \"" + item + "\", accepted: " + accepted_names(scene));
    }
    std::size_t used = 0;
    double number = 0;
    try {
      number = std::stod(value, &used);
    } catch (const std::exception&) {
      used = std::string::npos;
    }
    if (used != value.size() || !std::isfinite(number)) {
      throw Error("--pose " + full_name, "found \"" + value + "\", accepted: a finite number");
    }
    if (known->component == Component::size && !(number > 0)) {
      throw Error("--pose " + full_name, "found \"" + value + "\", accepted: above 0");
    }
    placements[static_cast<std::size_t>(object)].set(known->component, number * known->unit);
  }
  return placements;
}

std::map<std::string, double> truth_of(const Scene& scene,
                                       const std::vector<Placement>& placements) {
  std::map<std::string, double> truth;
  for (const Unknown& unknown : scene.unknowns) {
    truth[unknown_name(scene, unknown)] =
        placements[static_cast<std::size_t>(unknown.object)].get(unknown.component);
  }
  return truth;
}

}  // namespace blindcorner
