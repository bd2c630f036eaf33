// SPDX-License-Identifier: Apache-2.0
#include "io/capture_metadata.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <nlohmann/json.hpp>

#include "blindcorner/forward/error.h"
#include "forward/scene/limits.h"
#include "io/json_reader.h"

namespace blindcorner {
namespace {

using Json = nlohmann::ordered_json;

constexpr Component kComponents[] = {Component::x, Component::y, Component::z, Component::yaw,
                                     Component::size};
constexpr const char* kFormat = "blindcorner.capture/1";
/// Most rows, columns or bins that are believed; real sensors are far below.
constexpr int kLargestExtent = 1 << 20;
/// Most counts of a file: their places are 32-bit numbers.
constexpr double kMostCounts = std::numeric_limits<int>::max();

/// Picoseconds as a person would have written them: 88, not 88.00000000000001.
double picoseconds(double seconds) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%.13g", seconds * 1e12);
  const double rounded = std::strtod(digits, nullptr);
  return rounded / 1e12 == seconds ? rounded : seconds * 1e12;
}

Json vector_json(const Eigen::Vector3d& v) { return Json::array({v.x(), v.y(), v.z()}); }

Json pose_json(const Transform& T_world_sensor) {
  Eigen::Quaterniond q(T_world_sensor.linear());
  q.normalize();
  if (q.w() < 0.0) q.coeffs() *= -1.0;  // one of the two signs, so that files compare
  return {{"position_m", vector_json(T_world_sensor.translation())},
          {"quaternion_wxyz", Json::array({q.w(), q.x(), q.y(), q.z()})}};
}

Json capture_json(const Capture& capture) {
  Json json;
  json["exposures"] = capture.exposures;
  if (capture.zone_exposures) json["zone_exposures"] = *capture.zone_exposures;
  if (capture.dispersion) json["dispersion"] = *capture.dispersion;
  if (capture.T_world_sensor) json["sensor_pose"] = pose_json(*capture.T_world_sensor);
  if (capture.relay_points) {
    Json points = Json::array();
    for (const Eigen::Vector3d& point : *capture.relay_points) points.push_back(vector_json(point));
    json["relay_points_m"] = std::move(points);
  }
  if (!capture.truth.empty()) json["truth"] = capture.truth;
  json["source"] = capture.source;
  json["index"] = capture.index;
  return json;
}

/// Names of the components in `truth`: for the only object, and for one among several.
std::vector<std::string> names_of_components() {
  std::vector<std::string> names;
  for (const char* prefix : {"", "NAME."}) {
    for (const Component component : kComponents) {
      names.push_back(prefix + std::string(component_name(component)));
    }
  }
  return names;
}

Transform parse_pose(const JsonReader& reader) {
  reader.allow_only({"position_m", "quaternion_wxyz"});
  Transform pose = Transform::Identity();
  pose.translation() = reader.at("position_m").vector(limits::kPosition);
  pose.linear() = reader.at("quaternion_wxyz").quaternion().toRotationMatrix();
  return pose;
}

std::vector<Eigen::Vector3d> parse_points(const JsonReader& reader, std::size_t zones) {
  std::vector<Eigen::Vector3d> points;
  for (const JsonReader& point : reader.elements_exactly(zones, "points")) {
    const auto parts = point.elements_exactly(3, "numbers");
    // JSON has no NaN; dead zones have no point and are written as null.
    points.push_back(
        std::ranges::all_of(parts, &JsonReader::is_null)
            ? Eigen::Vector3d::Constant(std::nan(""))
            : Eigen::Vector3d{parts[0].number(), parts[1].number(), parts[2].number()});
  }
  return points;
}

Capture parse_capture(const JsonReader& reader, int rows, int columns, int bins) {
  reader.allow_only({"exposures", "zone_exposures", "dispersion", "sensor_pose", "relay_points_m",
                     "truth", "source", "index"});
  const std::size_t zones = static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
  Capture capture;
  capture.counts.rows = rows;
  capture.counts.columns = columns;
  capture.counts.bins = bins;
  capture.exposures = reader.at("exposures").number_or(capture.exposures, limits::kPositive);
  if (reader.has("zone_exposures")) {
    capture.zone_exposures.emplace();
    for (const JsonReader& zone : reader.at("zone_exposures").elements_exactly(zones, "numbers")) {
      capture.zone_exposures->push_back(zone.number(limits::kNotNegative));
    }
  }
  if (reader.has("dispersion")) {
    capture.dispersion = reader.at("dispersion").number(limits::kPositive);
  }
  if (reader.has("sensor_pose")) capture.T_world_sensor = parse_pose(reader.at("sensor_pose"));
  if (reader.has("relay_points_m")) {
    capture.relay_points = parse_points(reader.at("relay_points_m"), zones);
  }
  if (reader.has("truth")) {
    reader.at("truth").looks_for(names_of_components());
    for (const auto& [name, value] : reader.at("truth").fields()) {
      if (!is_component(name)) {
        value.fail("an unknown field", "x_m, y_m, z_m, yaw_rad, size, also as NAME.x_m");
      }
      capture.truth[name] = value.number();
    }
  }
  return capture;
}

void check_count(int rows, int columns, int bins, std::size_t captures, const std::string& where) {
  if (static_cast<double>(rows) * columns * bins * static_cast<double>(captures) > kMostCounts) {
    throw Error(where, "has " + std::to_string(captures) + " captures of " + std::to_string(rows) +
                           " x " + std::to_string(columns) + " zones of " + std::to_string(bins) +
                           " bins, accepted: at most 2^31 counts in a file");
  }
}

void check_positive(double value, const std::string& where) {
  if (!(value > 0.0) || !std::isfinite(value)) {
    throw Error(where, "found " + std::to_string(value) + ", accepted: a finite number > 0");
  }
}

void check_capture(const Capture& capture, const HistogramCube& first, const std::string& where) {
  const HistogramCube& cube = capture.counts;
  if (cube.rows != first.rows || cube.columns != first.columns || cube.bins != first.bins) {
    auto extent = [](const HistogramCube& c) {
      return std::to_string(c.rows) + " x " + std::to_string(c.columns) + " x " +
             std::to_string(c.bins);
    };
    throw Error(where, "has " + extent(cube) + " rows x columns x bins, the first capture has " +
                           extent(first) + "; one file holds one size");
  }
  const std::size_t expected = static_cast<std::size_t>(cube.zones()) * std::size_t(cube.bins);
  if (cube.rows < 1 || cube.columns < 1 || cube.bins < 1 || cube.values.size() != expected) {
    throw Error(where, "holds " + std::to_string(cube.values.size()) + " values for " +
                           std::to_string(cube.rows) + " x " + std::to_string(cube.columns) +
                           " zones of " + std::to_string(cube.bins) + " bins");
  }
  check_positive(capture.exposures, where + ".exposures");
  if (capture.zone_exposures) {
    if (capture.zone_exposures->size() != std::size_t(cube.zones())) {
      throw Error(where + ".zone_exposures",
                  "found " + std::to_string(capture.zone_exposures->size()) +
                      " numbers, accepted " + std::to_string(cube.zones()) + ", one per zone");
    }
    for (const double exposures : *capture.zone_exposures) {
      if (!(exposures >= 0.0) || !std::isfinite(exposures)) {
        throw Error(where + ".zone_exposures",
                    "found " + std::to_string(exposures) + ", accepted: a finite number >= 0");
      }
    }
  }
  if (capture.dispersion) check_positive(*capture.dispersion, where + ".dispersion");
  if (capture.T_world_sensor && !capture.T_world_sensor->matrix().allFinite()) {
    throw Error(where + ".sensor_pose", "is not finite");
  }
  if (capture.T_world_sensor &&
      capture.T_world_sensor->translation().cwiseAbs().maxCoeff() > limits::kPosition.upper) {
    throw Error(where + ".sensor_pose.position_m",
                "found a coordinate beyond 1e7 m, accepted: " + limits::kPosition.text());
  }
  if (capture.relay_points && capture.relay_points->size() != std::size_t(cube.zones())) {
    throw Error(where + ".relay_points", "found " + std::to_string(capture.relay_points->size()) +
                                             " points, accepted " + std::to_string(cube.zones()) +
                                             ", one per zone");
  }
  for (const auto& [name, value] : capture.truth) {
    if (!std::isfinite(value)) throw Error(where + ".truth." + name, "is not finite");
  }
}

}  // namespace

bool is_component(const std::string& name) {
  const std::string component = name.substr(name.rfind('.') + 1);  // from 0 where there is no dot
  return std::ranges::any_of(kComponents,
                             [&](Component c) { return component == component_name(c); });
}

void check_captures(const CaptureFile& file, const std::string& path) {
  if (file.captures.empty()) throw Error(path, "there are no captures to write");
  if (!(file.bin_width >= 0.0) || !std::isfinite(file.bin_width)) {
    throw Error(path, "bin_width is " + std::to_string(file.bin_width) +
                          " s, accepted: a finite number >= 0 (0: unknown)");
  }
  const HistogramCube& first = file.captures.front().counts;
  for (const int extent : {first.rows, first.columns, first.bins}) {
    if (extent <= kLargestExtent) continue;
    throw Error(path, "found " + std::to_string(extent) +
                          " rows, columns or bins, accepted: at most " +
                          std::to_string(kLargestExtent));
  }
  check_count(first.rows, first.columns, first.bins, file.captures.size(), path);
  for (std::size_t i = 0; i < file.captures.size(); ++i) {
    check_capture(file.captures[i], first, path + ": captures[" + std::to_string(i) + "]");
  }
}

std::string metadata_text(const CaptureFile& file) {
  const HistogramCube& cube = file.captures.front().counts;
  Json json;
  json["format"] = kFormat;
  json["rows"] = cube.rows;
  json["columns"] = cube.columns;
  json["bins"] = cube.bins;
  json["bin_width_ps"] = picoseconds(file.bin_width);
  json["sensor"] = file.sensor;
  json["description"] = file.description;
  json["captures"] = Json::array();
  for (const Capture& capture : file.captures) json["captures"].push_back(capture_json(capture));
  // File names need not be UTF-8, JSON must be.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

CaptureFile parse_metadata(const std::string& text, const std::string& where) {
  const Json json = JsonReader::parse(text, where);
  const JsonReader root(json, where);
  root.at("format").word({kFormat});
  root.allow_only(
      {"format", "rows", "columns", "bins", "bin_width_ps", "sensor", "description", "captures"});
  const int rows = root.at("rows").integer(1, kLargestExtent);
  const int columns = root.at("columns").integer(1, kLargestExtent);
  const int bins = root.at("bins").integer(1, kLargestExtent);
  const std::vector<JsonReader> captures = root.at("captures").elements(1);
  check_count(rows, columns, bins, captures.size(), where);
  CaptureFile file;
  file.bin_width = root.at("bin_width_ps").number_or(0, limits::kNotNegative) / 1e12;
  file.sensor = root.at("sensor").text_or("");
  file.description = root.at("description").text_or("");
  for (const JsonReader& capture : captures) {
    file.captures.push_back(parse_capture(capture, rows, columns, bins));
  }
  return file;
}

}  // namespace blindcorner
