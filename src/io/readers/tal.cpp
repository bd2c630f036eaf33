// SPDX-License-Identifier: Apache-2.0
#include "io/readers/tal.h"

#include <cmath>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "io/hdf5_file.h"
#include "io/readers/capture_reader.h"

namespace blindcorner {
namespace {

/// tal.enums: how `H` and the grids are laid out.
enum HFormat {
  kTimeColumnsRows = 1,
  kTimeLaserGridSensorGrid = 2,
  kTimeSensors = 3,
  kTimeLasersSensors = 4
};
enum GridFormat { kUnknownGrid = 0, kPoints = 1, kGridOfPoints = 2 };

Eigen::Vector3d to_world(const double* p) { return {p[0], -p[2], p[1]}; }
Eigen::Vector3d to_tal(const Eigen::Vector3d& p) { return {p.x(), p.z(), -p.y()}; }

std::string number(double value) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%.6g", value + 0.0);  // no -0
  return digits;
}

/// Rows and columns of the sensor's points. Time is the first axis of H, and axes of the laser have
/// one element.
std::pair<int, int> sensor_grid(const NpyArray& h, int format, const std::string& where) {
  const auto fail = [&](const std::string& accepted) -> Error {
    return Error(where, "has shape " + h.shape_text() + " and H_format " + std::to_string(format) +
                            ", accepted " + accepted);
  };
  const std::vector<std::size_t>& shape = h.shape;
  const auto extent = [&](std::size_t axis) { return static_cast<int>(shape[axis]); };
  switch (format) {
    case kTimeColumnsRows:
      if (shape.size() != 3) throw fail("[T, Sx, Sy]");
      return {extent(1), extent(2)};
    case kTimeSensors:
      if (shape.size() != 2) throw fail("[T, Si]");
      return {extent(1), 1};
    case kTimeLaserGridSensorGrid:
      if (shape.size() != 5 || shape[1] * shape[2] != 1) {
        throw fail("[T, 1, 1, Sx, Sy]: one spot of the laser, or confocal [T, Sx, Sy]");
      }
      return {extent(3), extent(4)};
    case kTimeLasersSensors:
      if (shape.size() != 3 || shape[1] != 1) {
        throw fail("[T, 1, Si]: one spot of the laser, or confocal [T, Si]");
      }
      return {extent(2), 1};
    default:
      throw fail("T_Sx_Sy (1), T_Lx_Ly_Sx_Sy (2), T_Si (3) or T_Li_Si (4)");
  }
}

/// The points of a grid; nothing where the file does not hold them.
std::vector<Eigen::Vector3d> points(const Hdf5Reader& file, const std::string& name) {
  std::vector<Eigen::Vector3d> all;
  if (!file.has(name)) return all;
  const NpyArray array = file.numbers(name);
  for (std::size_t i = 0; i + 2 < array.values.size(); i += 3) {
    all.push_back(to_world(&array.values[i]));
  }
  return all;
}

/// A sensor at `place` that looks at `target`, upright.
Transform looking_at(const Eigen::Vector3d& place, const Eigen::Vector3d& target) {
  Transform pose = Transform::Identity();
  pose.translation() = place;
  const Eigen::Vector3d ahead = target - place;
  if (ahead.norm() < 1e-9) return pose;
  const Eigen::Vector3d x = ahead.normalized();
  const Eigen::Vector3d up =
      std::abs(x.z()) > 0.999 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d y = up.cross(x).normalized();
  pose.linear() << x, y, x.cross(y);
  return pose;
}

void note_times(const Hdf5Reader& file, const std::string& path, ImportNotes& notes) {
  const double start = file.has("t_start") ? file.number("t_start") : 0.0;
  if (start != 0.0) {
    notes.push_back(path + ": bin 0 begins at " + number(start) +
                    " m of path (t_start), so that a scene's time_zero_ps is " +
                    number(-start / kSpeedOfLight * 1e12));
  }
  if (!file.has("t_accounts_first_and_last_bounces") ||
      file.number("t_accounts_first_and_last_bounces") == 0.0) {
    notes.push_back(path +
                    ": times begin and end at the relay wall (t_accounts_first_and_last_bounces), "
                    "so that sensor and laser of a scene stand on it");
  }
}

std::string describe_laser(const std::vector<Eigen::Vector3d>& laser,
                           const std::vector<Eigen::Vector3d>& sensor) {
  if (laser.empty()) return "";
  const bool confocal =
      laser.size() == sensor.size() &&
      std::equal(laser.begin(), laser.end(), sensor.begin(),
                 [](const auto& a, const auto& b) { return (a - b).norm() < 1e-6; });
  if (confocal) return "; confocal";
  if (laser.size() > 1) return "; " + std::to_string(laser.size()) + " spots of the laser";
  return "; laser spot at " + number(laser[0].x()) + ", " + number(laser[0].y()) + ", " +
         number(laser[0].z()) + " m";
}

bool recognise(const ImportSource& source) {
  if (!source.beginning().starts_with("\x89HDF\r\n\x1a\n")) return false;
  if (!has_hdf5()) return true;  // so that the reader says what it lacks
  const Hdf5Reader file(source.path());
  return file.has("H") && file.has("H_format");
}

CaptureFile read(const ImportSource& source, const ImportOptions&, ImportNotes& notes) {
  const std::string& path = source.path();
  const Hdf5Reader file(path);
  const NpyArray h = file.numbers("H");
  const auto [rows, columns] =
      sensor_grid(h, static_cast<int>(file.number("H_format")), path + ": dataset H");
  Capture capture;
  const std::size_t bins = h.shape[0];
  const auto zones = static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
  if (h.values.empty()) throw Error(path + ": dataset H", "is empty");
  capture.counts = HistogramCube(rows, columns, static_cast<int>(bins));
  for (std::size_t zone = 0; zone < zones; ++zone) {
    double* out = capture.counts.zone(static_cast<int>(zone));
    for (std::size_t bin = 0; bin < bins; ++bin) out[bin] = h.values[bin * zones + zone];
  }
  const std::vector<Eigen::Vector3d> sensor = points(file, "sensor_grid_xyz");
  if (!sensor.empty() && sensor.size() != zones) {
    throw Error(path + ": dataset sensor_grid_xyz", "holds " + std::to_string(sensor.size()) +
                                                        " points, accepted one for each of " +
                                                        std::to_string(zones) + " histograms");
  }
  if (!sensor.empty()) capture.relay_points = sensor;
  if (file.has("sensor_xyz")) {
    const NpyArray place = file.numbers("sensor_xyz");
    if (place.values.size() != 3) {
      throw Error(path + ": dataset sensor_xyz",
                  "has shape " + place.shape_text() + ", accepted (3,)");
    }
    Eigen::Vector3d target = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& point : sensor)
      target += point / static_cast<double>(sensor.size());
    capture.T_world_sensor = looking_at(to_world(place.values.data()), target);
  }
  note_times(file, path, notes);
  CaptureFile captures;
  captures.bin_width = file.number("delta_t") / kSpeedOfLight;
  if (!(captures.bin_width > 0)) {
    throw Error(path + ": dataset delta_t",
                "found " + number(file.number("delta_t")) + ", accepted metres > 0");
  }
  captures.description = "tal; world (x, y, z) is (x, -z, y) of the file" +
                         describe_laser(points(file, "laser_grid_xyz"), sensor);
  captures.captures.push_back(std::move(capture));
  return captures;
}

void write_points(Hdf5Writer& file, const std::string& name, const Capture& capture) {
  std::vector<double> values;
  for (const Eigen::Vector3d& point : *capture.relay_points) {
    const Eigen::Vector3d turned = to_tal(point);
    values.insert(values.end(), turned.begin(), turned.end());
  }
  file.floats(name,
              {static_cast<std::size_t>(capture.counts.rows),
               static_cast<std::size_t>(capture.counts.columns), 3},
              values);
}

void write_place(Hdf5Writer& file, const std::string& name, const Capture& capture) {
  if (!capture.T_world_sensor) return file.empty(name);
  const Eigen::Vector3d turned = to_tal(capture.T_world_sensor->translation());
  file.floats(name, {3}, {turned.x(), turned.y(), turned.z()});
}

}  // namespace

CaptureReader tal_reader() {
  return {.name = "tal",
          .recognises = "HDF5 of tal (y-tal) with H and H_format",
          .assumes = "the file's relay wall is z = 0 and y is up",
          .options = {},
          .recognise = recognise,
          .read = read};
}

std::string tal_file(const CaptureFile& file, const ExportOptions& options,
                     const std::string& path) {
  if (file.captures.size() > 1 && options.capture < 0) {
    throw Error(path, "a tal file holds one capture, found " +
                          std::to_string(file.captures.size()) + ", accepted: --capture chooses");
  }
  const auto chosen = static_cast<std::size_t>(std::max(options.capture, 0));
  if (chosen >= file.captures.size()) {
    throw Error("capture", "found " + std::to_string(options.capture) + ", accepted 0 to " +
                               std::to_string(file.captures.size() - 1));
  }
  if (file.bin_width <= 0) throw Error(path, "the captures do not say how wide a bin is");
  const Capture& capture = file.captures[chosen];
  const HistogramCube& counts = capture.counts;
  if (options.confocal && !capture.relay_points) {
    throw Error("confocal", "the capture holds no points that its zones look at");
  }
  std::vector<double> h(counts.values.size());
  for (int zone = 0; zone < counts.zones(); ++zone) {
    for (int bin = 0; bin < counts.bins; ++bin) {
      h[static_cast<std::size_t>(bin) * static_cast<std::size_t>(counts.zones()) +
        static_cast<std::size_t>(zone)] = counts.zone(zone)[bin];
    }
  }
  const std::vector<std::pair<std::string, int>> h_formats = {
      {"UNKNOWN", 0}, {"T_Sx_Sy", 1}, {"T_Lx_Ly_Sx_Sy", 2}, {"T_Si", 3}, {"T_Li_Si", 4}};
  const std::vector<std::pair<std::string, int>> grids = {{"UNKNOWN", 0}, {"N_3", 1}, {"X_Y_3", 2}};
  Hdf5Writer out;
  out.floats("H",
             {static_cast<std::size_t>(counts.bins), static_cast<std::size_t>(counts.rows),
              static_cast<std::size_t>(counts.columns)},
             h);
  out.enumerator("H_format", h_formats, kTimeColumnsRows);
  for (const std::string side : {"sensor", "laser"}) {
    const bool known = capture.relay_points && (side == "sensor" || options.confocal);
    if (known) {
      write_place(out, side + "_xyz", capture);
      write_points(out, side + "_grid_xyz", capture);
    } else {
      out.empty(side + "_xyz");
      out.empty(side + "_grid_xyz");
    }
    out.empty(side + "_grid_normals");
    out.enumerator(side + "_grid_format", grids, known ? kGridOfPoints : kUnknownGrid);
  }
  out.floats("delta_t", {}, {file.bin_width * kSpeedOfLight});
  out.floats("t_start", {}, {-options.time_zero * kSpeedOfLight});
  out.truth("t_accounts_first_and_last_bounces", true);
  out.text("scene_info", "{original_format: blindcorner}\n");
  return out.bytes();
}

}  // namespace blindcorner
