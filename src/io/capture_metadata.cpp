// SPDX-License-Identifier: Apache-2.0
#include "io/capture_metadata.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <initializer_list>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>

#include "blindcorner/forward/error.h"
#include "io/file_bytes.h"
#include "io/json_depth.h"
#include "io/json_reader.h"

namespace blindcorner {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "blindcorner.capture/1";
/// Most rows, columns or bins that are believed; real sensors are far below.
constexpr int kLargestExtent = 1 << 20;
/// Rounding to a few digits of a quaternion written by hand; more than that is a mistake.
constexpr double kQuaternionTolerance = 1e-3;

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

/// A place in the metadata that knows how to name itself in messages.
struct Field {
  const Json& json;
  std::string where;

  [[noreturn]] void fail(const std::string& accepted) const {
    std::string found = json.dump(-1, ' ', false, Json::error_handler_t::replace);
    if (found.size() > 60) found = found.substr(0, 57) + "...";
    throw Error(where, "found " + found + ", accepted " + accepted);
  }
  bool has(const char* key) const { return json.is_object() && json.contains(key); }
  Field at(const char* key) const {
    if (!json.is_object()) fail("an object");
    const auto found = json.find(key);
    if (found == json.end()) throw Error(where, std::string("field ") + key + " is missing");
    return {*found, where + "." + key};
  }
  Field item(std::size_t i) const { return {json[i], where + "[" + std::to_string(i) + "]"}; }

  double number() const {
    if (!json.is_number()) fail("a number");
    return json.get<double>();
  }
  double positive() const {
    if (!json.is_number() || !(json.get<double>() > 0.0)) fail("a number > 0");
    return json.get<double>();
  }
  int count(int smallest) const {
    if (!json.is_number_integer() || json.get<double>() < smallest ||
        json.get<double>() > kLargestExtent) {
      fail("a whole number from " + std::to_string(smallest) + " to " +
           std::to_string(kLargestExtent));
    }
    return json.get<int>();
  }
  std::string text() const {
    if (!json.is_string()) fail("a string");
    return json.get<std::string>();
  }
  /// Refuses fields of other names.
  void allow_only(std::initializer_list<std::string_view> known) const {
    for (const auto& item : json.items()) {
      if (std::ranges::find(known, item.key()) != known.end()) continue;
      std::vector<std::string> names(known.begin(), known.end());
      throw Error(where + "." + item.key(),
                  "found an unknown field, accepted: " + list_words(names));
    }
  }
  /// An array, of `size` elements unless that is negative.
  const Json& array(int size = -1) const {
    if (!json.is_array() || (size >= 0 && json.size() != static_cast<std::size_t>(size))) {
      fail(size < 0 ? "an array" : "an array of " + std::to_string(size) + " elements");
    }
    return json;
  }
};

Transform parse_pose(const Field& field) {
  const Field position = field.at("position_m");
  const Field rotation = field.at("quaternion_wxyz");
  position.array(3);
  rotation.array(4);
  const Eigen::Quaterniond q(rotation.item(0).number(), rotation.item(1).number(),
                             rotation.item(2).number(), rotation.item(3).number());
  if (!(std::abs(q.norm() - 1.0) <= kQuaternionTolerance)) rotation.fail("a unit quaternion");
  Transform pose = Transform::Identity();
  pose.linear() = q.normalized().toRotationMatrix();
  for (std::size_t i = 0; i < 3; ++i) {
    pose.translation()(static_cast<Eigen::Index>(i)) = position.item(i).number();
  }
  return pose;
}

std::vector<Eigen::Vector3d> parse_points(const Field& field, int zones) {
  field.array(zones);
  std::vector<Eigen::Vector3d> points;
  for (std::size_t z = 0; z < field.json.size(); ++z) {
    const Field point = field.item(z);
    point.array(3);
    Eigen::Vector3d p;
    for (std::size_t i = 0; i < 3; ++i) {
      // JSON has no NaN; dead zones have no point and are written as null.
      const Field coordinate = point.item(i);
      p(static_cast<Eigen::Index>(i)) = coordinate.json.is_null()
                                            ? std::numeric_limits<double>::quiet_NaN()
                                            : coordinate.number();
    }
    points.push_back(p);
  }
  return points;
}

Capture parse_capture(const Field& field, int rows, int columns, int bins) {
  if (!field.json.is_object()) field.fail("an object");
  field.allow_only({"exposures", "zone_exposures", "dispersion", "sensor_pose", "relay_points_m",
                    "truth", "source", "index"});
  Capture capture;
  capture.counts.rows = rows;
  capture.counts.columns = columns;
  capture.counts.bins = bins;
  if (field.has("exposures")) capture.exposures = field.at("exposures").positive();
  if (field.has("zone_exposures")) {
    const Field list = field.at("zone_exposures");
    list.array(rows * columns);
    capture.zone_exposures.emplace();
    for (std::size_t z = 0; z < list.json.size(); ++z) {
      const double exposures = list.item(z).number();
      if (exposures < 0) list.item(z).fail("a number >= 0");
      capture.zone_exposures->push_back(exposures);
    }
  }
  if (field.has("dispersion")) capture.dispersion = field.at("dispersion").positive();
  if (field.has("sensor_pose")) capture.T_world_sensor = parse_pose(field.at("sensor_pose"));
  if (field.has("relay_points_m")) {
    capture.relay_points = parse_points(field.at("relay_points_m"), rows * columns);
  }
  if (field.has("truth")) {
    const Field truth = field.at("truth");
    if (!truth.json.is_object()) truth.fail("an object of numbers");
    for (const auto& item : truth.json.items()) {
      capture.truth[item.key()] = truth.at(item.key().c_str()).number();
    }
  }
  return capture;
}

void check_positive(double value, const std::string& where) {
  if (!(value > 0.0) || !std::isfinite(value)) {
    throw Error(where, "found " + std::to_string(value) + ", accepted a finite number > 0");
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
                    "found " + std::to_string(exposures) + ", accepted a finite number >= 0");
      }
    }
  }
  if (capture.dispersion) check_positive(*capture.dispersion, where + ".dispersion");
  if (capture.T_world_sensor && !capture.T_world_sensor->matrix().allFinite()) {
    throw Error(where + ".sensor_pose", "is not finite");
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

void check_captures(const CaptureFile& file, const std::string& path) {
  if (file.captures.empty()) throw Error(path, "there are no captures to write");
  if (!(file.bin_width >= 0.0) || !std::isfinite(file.bin_width)) {
    throw Error(path, "bin_width is " + std::to_string(file.bin_width) +
                          " s, accepted a finite number >= 0 (0: unknown)");
  }
  for (std::size_t i = 0; i < file.captures.size(); ++i) {
    check_capture(file.captures[i], file.captures.front().counts,
                  path + ": captures[" + std::to_string(i) + "]");
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
  check_json_depth(text, where);
  Json json;
  try {
    json = Json::parse(text);
  } catch (const nlohmann::json::exception& error) {
    throw Error(where, "is not JSON: " + one_line(error.what()));
  }
  const Field root{json, where};
  if (root.at("format").text() != kFormat) {
    root.at("format").fail(std::string("\"") + kFormat + "\"");
  }
  root.allow_only(
      {"format", "rows", "columns", "bins", "bin_width_ps", "sensor", "description", "captures"});
  const int rows = root.at("rows").count(1);
  const int columns = root.at("columns").count(1);
  const int bins = root.at("bins").count(1);
  const Field captures = root.at("captures");
  captures.array();
  if (captures.json.empty()) captures.fail("at least one capture");
  if (static_cast<double>(rows) * columns * bins * static_cast<double>(captures.json.size()) >
      std::numeric_limits<int>::max()) {
    throw Error(where, "declares more than 2^31 counts");
  }
  CaptureFile file;
  if (root.has("bin_width_ps")) {
    const double width_ps = root.at("bin_width_ps").number();
    if (width_ps < 0.0) root.at("bin_width_ps").fail("a number >= 0 (0: unknown)");
    file.bin_width = width_ps / 1e12;
  }
  if (root.has("sensor")) file.sensor = root.at("sensor").text();
  if (root.has("description")) file.description = root.at("description").text();
  for (std::size_t i = 0; i < captures.json.size(); ++i) {
    file.captures.push_back(parse_capture(captures.item(i), rows, columns, bins));
  }
  return file;
}

}  // namespace blindcorner
