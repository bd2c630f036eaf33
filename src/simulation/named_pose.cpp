// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/named_pose.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string_view>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/orientation.h"

namespace blindcorner {
namespace {

struct PoseName {
  std::string_view name;
  Component component;
  double unit;
};
constexpr PoseName kNames[] = {
    {"x_m", Component::x, 1.0},       {"y_m", Component::y, 1.0},
    {"z_m", Component::z, 1.0},       {"yaw_deg", Component::yaw, kDegree},
    {"yaw_rad", Component::yaw, 1.0}, {"size", Component::size, 1.0},
};

/// Where a value stands among x, y, z (m), yaw, pitch, roll (rad).
struct SensorPoseName {
  std::string_view name;
  Eigen::Index place;
  double unit;
};
constexpr SensorPoseName kSensorNames[] = {
    {"x_m", 0, 1.0},         {"y_m", 1, 1.0},          {"z_m", 2, 1.0},
    {"yaw_deg", 3, kDegree}, {"yaw_rad", 3, 1.0},      {"pitch_deg", 4, kDegree},
    {"pitch_rad", 4, 1.0},   {"roll_deg", 5, kDegree}, {"roll_rad", 5, 1.0},
};

/// Takes an object's "front." off the front of a name. Returns the object's index; -1: no such
/// object.
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

struct NamedComponent {
  int object = 0;
  const PoseName* component = nullptr;
};

NamedComponent component_of(const Scene& scene, const std::string& where,
                            const std::string& full_name) {
  std::string name = full_name;
  const int object = take_object(scene, name);
  const auto known = std::ranges::find(kNames, name, &PoseName::name);
  if (known == std::end(kNames) || object < 0) {
    throw Error(where, "found \"" + full_name + "\", accepted: " + accepted_names(scene));
  }
  return {object, known};
}

const SensorPoseName& sensor_component(const std::string& where, const std::string& name) {
  const auto known = std::ranges::find(kSensorNames, name, &SensorPoseName::name);
  if (known == std::end(kSensorNames)) {
    throw Error(where, "found \"" + name +
                           "\", accepted: x_m, y_m, z_m, yaw_deg, pitch_deg, roll_deg (or _rad), "
                           "each with a number");
  }
  return *known;
}

void check_number(const std::string& where, const NamedNumber& value) {
  if (std::isfinite(value.second)) return;
  throw Error(where + " " + value.first, "accepted: a finite number");
}

}  // namespace

void check_pose_name(const Scene& scene, const std::string& where, const std::string& name) {
  component_of(scene, where, name);
}

std::vector<Placement> placements_from(const Scene& scene, const std::string& where,
                                       const std::vector<NamedNumber>& values) {
  std::vector<Placement> placements = stated_placements(scene);
  for (const NamedNumber& value : values) {
    const auto [object, known] = component_of(scene, where, value.first);
    check_number(where, value);
    if (known->component == Component::size && !(value.second > 0)) {
      throw Error(where + " " + value.first,
                  "found \"" + std::to_string(value.second) + "\", accepted: above 0");
    }
    placements[static_cast<std::size_t>(object)].set(known->component, value.second * known->unit);
  }
  return placements;
}

void check_sensor_pose_name(const std::string& where, const std::string& name) {
  sensor_component(where, name);
}

Transform sensor_pose_from(const Scene& scene, const std::string& where,
                           const std::vector<NamedNumber>& values) {
  Eigen::Matrix<double, 6, 1> pose;
  pose << scene.T_world_sensor.translation(), yaw_pitch_roll_of(scene.T_world_sensor.linear());
  bool turned = false;
  for (const NamedNumber& value : values) {
    const SensorPoseName& known = sensor_component(where, value.first);
    check_number(where, value);
    turned = turned || known.place > 2;
    pose[known.place] = value.second * known.unit;
  }
  Transform T_world_sensor = scene.T_world_sensor;
  T_world_sensor.translation() = pose.head<3>();
  if (turned) T_world_sensor.linear() = rotation_of(pose.tail<3>());
  return T_world_sensor;
}

}  // namespace blindcorner
