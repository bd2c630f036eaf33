// SPDX-License-Identifier: Apache-2.0
#include "commands/pose_text.h"

#include <cmath>
#include <sstream>

#include "blindcorner/forward/error.h"
#include "blindcorner/simulation/named_pose.h"
#include "commands/csv_table.h"

namespace blindcorner {
namespace {

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

Transform sensor_pose_of(const Scene& scene, const std::string& where,
                         const std::vector<NamedText>& values) {
  std::vector<NamedNumber> numbers;
  for (const auto& [name, value] : values) {
    check_sensor_pose_name(where, name);
    numbers.emplace_back(name, finite_number(where + " " + name, value));
  }
  return sensor_pose_from(scene, where, numbers);
}

}  // namespace

std::vector<Placement> parse_pose(const Scene& scene, const std::string& text) {
  std::vector<NamedNumber> numbers;
  for (const auto& [name, value] : pairs_of(text)) {
    check_pose_name(scene, "--pose", name);
    numbers.emplace_back(name, finite_number("--pose " + name, value));
  }
  return placements_from(scene, "--pose", numbers);
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

}  // namespace blindcorner
