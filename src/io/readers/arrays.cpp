// SPDX-License-Identifier: Apache-2.0
#include "io/readers/arrays.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

std::vector<std::string> split_list(const std::string& list) {
  std::vector<std::string> items;
  for (std::size_t begin = 0; begin <= list.size();) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    std::string item = list.substr(begin, end - begin);
    item.erase(0, std::min(item.find_first_not_of(' '), item.size()));
    item.erase(item.find_last_not_of(' ') + 1);
    items.push_back(std::move(item));
    begin = end + 1;
  }
  return items;
}

/// One named axis of an array in C order.
struct Axis {
  bool present = false;
  std::size_t extent = 1;
  std::size_t stride = 0;  ///< elements
};
struct Axes {
  Axis capture, row, column, zone, bin;

  Axis* find(const std::string& name) {
    if (name == "capture") return &capture;
    if (name == "row") return &row;
    if (name == "column") return &column;
    if (name == "zone") return &zone;
    if (name == "bin") return &bin;
    return nullptr;
  }
};

/// Names of the axes, checked for sense but not yet against an array.
std::vector<std::string> parse_axes(const std::string& text) {
  std::vector<std::string> names = split_list(text);
  Axes axes;
  for (const std::string& name : names) {
    Axis* axis = axes.find(name);
    if (axis == nullptr) {
      throw Error("axes", "found '" + name + "' in '" + text +
                              "', accepted a list of capture, row, column, zone and bin");
    }
    if (axis->present) throw Error("axes", name + " appears twice in '" + text + "'");
    axis->present = true;
  }
  if (!axes.bin.present) throw Error("axes", "bin is missing in '" + text + "'");
  if (axes.zone.present && (axes.row.present || axes.column.present)) {
    throw Error("axes", "zone stands for row and column, found both in '" + text + "'");
  }
  return names;
}

Axes bind_axes(const std::string& text, const NpyArray& array, const std::string& where) {
  const std::vector<std::string> names = parse_axes(text);
  if (names.size() != array.shape.size()) {
    throw Error(where, "has shape " + array.shape_text() + ", but axes '" + text + "' name " +
                           std::to_string(names.size()));
  }
  Axes axes;
  std::size_t stride = 1;
  for (std::size_t i = names.size(); i-- > 0;) {
    if (array.shape[i] == 0) throw Error(where, "is empty, its shape is " + array.shape_text());
    if (array.shape[i] > static_cast<std::size_t>(std::numeric_limits<int>::max())) {
      throw Error(where, "is too large, its shape is " + array.shape_text());
    }
    *axes.find(names[i]) = {true, array.shape[i], stride};
    stride *= array.shape[i];
  }
  return axes;
}

/// Rows and columns, from the array, the options or, failing both, a square.
std::pair<int, int> layout_of(const Axes& axes, const ImportOptions& options,
                              const std::string& where, ImportNotes& notes) {
  if (axes.zone.present) return zone_layout(axes.zone.extent, options, where, notes);
  const int rows = static_cast<int>(axes.row.extent);
  const int columns = static_cast<int>(axes.column.extent);
  if (options.rows != 0 && (options.rows != rows || options.columns != columns)) {
    throw Error(where, "has " + std::to_string(rows) + " x " + std::to_string(columns) +
                           " zones, but rows x columns are stated as " +
                           std::to_string(options.rows) + " x " + std::to_string(options.columns));
  }
  return {rows, columns};
}

std::vector<Capture> cut_captures(const NpyArray& array, const Axes& axes, int rows, int columns) {
  std::vector<Capture> captures(axes.capture.extent);
  for (std::size_t c = 0; c < captures.size(); ++c) {
    HistogramCube cube(rows, columns, static_cast<int>(axes.bin.extent));
    for (int z = 0; z < cube.zones(); ++z) {
      const std::size_t from =
          c * axes.capture.stride +
          (axes.zone.present ? static_cast<std::size_t>(z) * axes.zone.stride
                             : static_cast<std::size_t>(z / columns) * axes.row.stride +
                                   static_cast<std::size_t>(z % columns) * axes.column.stride);
      for (std::size_t k = 0; k < axes.bin.extent; ++k) {
        cube.zone(z)[k] = array.values[from + k * axes.bin.stride];
      }
    }
    captures[c].counts = std::move(cube);
  }
  return captures;
}

/// Rows are the world axes in data coordinates. May be a reflection.
Eigen::Matrix3d parse_world_axes(const std::string& text) {
  const auto fail = [&text] {
    return Error("axes_world",
                 "found '" + text + "', accepted x, y and z in any order and with signs: z,-x,y");
  };
  const std::vector<std::string> items = split_list(text);
  if (items.size() != 3) throw fail();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < 3; ++i) {
    std::string name = items[i];
    const bool negative = name.starts_with('-');
    if (negative || name.starts_with('+')) name.erase(0, 1);
    if (name != "x" && name != "y" && name != "z") throw fail();
    axes(static_cast<Eigen::Index>(i), name[0] - 'x') = negative ? -1.0 : 1.0;
  }
  if (axes.determinant() == 0.0) throw fail();  // an axis appears twice
  return axes;
}

}  // namespace

void check_axes(const std::string& axes) { parse_axes(axes); }

std::string reversed_axes(const std::string& axes) {
  std::string reversed;
  for (const std::string& name : split_list(axes)) {
    reversed.insert(0, name + (reversed.empty() ? "" : ","));
  }
  return reversed;
}

void check_world_axes(const std::string& axes_world) { parse_world_axes(axes_world); }

std::pair<int, int> zone_layout(std::size_t zones, const ImportOptions& options,
                                const std::string& where, ImportNotes& notes) {
  if (options.rows != 0) {
    if (static_cast<std::size_t>(options.rows) * static_cast<std::size_t>(options.columns) !=
        zones) {
      throw Error(where, "has " + std::to_string(zones) + " zones, but rows x columns are " +
                             std::to_string(options.rows) + " x " +
                             std::to_string(options.columns));
    }
    return {options.rows, options.columns};
  }
  const int side = static_cast<int>(std::lround(std::sqrt(static_cast<double>(zones))));
  if (static_cast<std::size_t>(side) * static_cast<std::size_t>(side) != zones) {
    throw Error(where,
                "has " + std::to_string(zones) + " zones: rows and columns have to be stated");
  }
  if (zones > 1) {
    notes.push_back(where + ": taking " + std::to_string(zones) + " zones as " +
                    std::to_string(side) + " rows of " + std::to_string(side));
  }
  return {side, side};
}

std::vector<Capture> arrange(const NpyArray& array, const ImportOptions& options,
                             const std::string& where, ImportNotes& notes) {
  if (array.is_text) throw Error(where, "holds text, accepted numbers");
  if (options.axes.empty()) {
    throw Error(where, "the order of its axes has to be stated for shape " + array.shape_text() +
                           ", for example capture,row,column,bin");
  }
  const Axes axes = bind_axes(options.axes, array, where);
  const auto [rows, columns] = layout_of(axes, options, where, notes);
  return cut_captures(array, axes, rows, columns);
}

NpyArray read_numbers(const NpzFile& archive, const std::string& path, const std::string& name) {
  NpyArray array = archive.read(name);
  if (array.is_text) throw Error(path + ": array " + name, "holds text, accepted numbers");
  return array;
}

void place_sensor(std::vector<Capture>& captures, const NpyArray& positions,
                  const ImportOptions& options, const std::string& where) {
  const bool one = positions.shape == std::vector<std::size_t>{3} && captures.size() == 1;
  if (!one && positions.shape != std::vector<std::size_t>{captures.size(), 3}) {
    throw Error(where, "has shape " + positions.shape_text() + ", accepted (" +
                           std::to_string(captures.size()) + ", 3): a position for each capture");
  }
  const Eigen::Matrix3d axes = parse_world_axes(options.axes_world);
  for (std::size_t c = 0; c < captures.size(); ++c) {
    const Eigen::Vector3d position(&positions.values[3 * c]);
    if (!position.allFinite()) {
      throw Error(where, "row " + std::to_string(c) + " is not finite");
    }
    Transform pose = Transform::Identity();
    pose.linear() = options.sensor_rotation.normalized().toRotationMatrix();
    pose.translation() = axes * position;
    captures[c].T_world_sensor = pose;
  }
}

}  // namespace blindcorner
