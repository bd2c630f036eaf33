// SPDX-License-Identifier: Apache-2.0
#include "commands/pose_text.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <sstream>
#include <string_view>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/orientation.h"
#include "commands/csv_table.h"

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

struct NamedText {
  std::string name, value;
};

/// NAME=VALUE pairs between commas; the value of a name without one is empty.
std::vector<NamedText> pairs_of(const std::string& text) {
  std::vector<NamedText> pairs;
  std::stringstream stream(text);
  for (std::string item; std::getline(stream, item, ',');) {
    const auto equals = item.find('=');
    pairs.push_back(
        {item.substr(0, equals), equals == std::string::npos ? "" : item.substr(equals + 1)});
  }
  return pairs;
}

double finite_number(const std::string& where, const std::string& text) {
  std::size_t used = 0;
  double number = 0;
  try {
    number = std::stod(text, &used);
  } catch (const std::exception&) {
    used = std::string::npos;
  }
  if (used != text.size() || !std::isfinite(number)) {
    throw Error(where, "found \"" + text + "\", accepted: a finite number");
  }
  return number;
}

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

Transform sensor_pose_of(const Scene& scene, const std::string& where,
                         const std::vector<NamedText>& values) {
  Eigen::Matrix<double, 6, 1> pose;
  pose << scene.T_world_sensor.translation(), yaw_pitch_roll_of(scene.T_world_sensor.linear());
  bool turned = false;
  for (const auto& [name, value] : values) {
    const auto known = std::ranges::find(kSensorNames, name, &SensorPoseName::name);
    if (known == std::end(kSensorNames)) {
      throw Error(where, "found \"" + name +
                             "\", accepted: x_m, y_m, z_m, yaw_deg, pitch_deg, roll_deg (or _rad), "
                             "each with a number");
    }
    turned = turned || known->place > 2;
    pose[known->place] = finite_number(where + " " + name, value) * known->unit;
  }
  Transform T_world_sensor = scene.T_world_sensor;
  T_world_sensor.translation() = pose.head<3>();
  if (turned) T_world_sensor.linear() = rotation_of(pose.tail<3>());
  return T_world_sensor;
}

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
  for (const auto& [full_name, value] : pairs_of(text)) {
    std::string name = full_name;
    const int object = take_object(scene, name);
    const auto known = std::ranges::find(kNames, name, &PoseName::name);
    if (known == std::end(kNames) || object < 0) {
      throw Error("--pose", "found \"" + full_name + "\", accepted: " + accepted_names(scene));
    }
    const double number = finite_number("--pose " + full_name, value);
    if (known->component == Component::size && !(number > 0)) {
      throw Error("--pose " + full_name, "found \"" + value + "\", accepted: above 0");
    }
    placements[static_cast<std::size_t>(object)].set(known->component, number * known->unit);
  }
  return placements;
}

Transform parse_sensor_pose(const Scene& scene, const std::string& option,
                            const std::string& text) {
  return sensor_pose_of(scene, option, pairs_of(text));
}

std::vector<Transform> read_sensor_poses(const Scene& scene, const std::string& path) {
  const CsvTable table = read_csv_table(path);
  std::vector<Transform> poses;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    std::vector<NamedText> values;
    for (std::size_t c = 0; c < table.header.size(); ++c) {
      values.push_back({table.header[c], table.rows[row][c]});
    }
    poses.push_back(sensor_pose_of(scene, csv_place(path, row), values));
  }
  if (poses.empty()) throw Error(path, "found no row, accepted: a pose of the sensor in each");
  return poses;
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
