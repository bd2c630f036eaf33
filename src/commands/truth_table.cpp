// SPDX-License-Identifier: Apache-2.0
#include "commands/truth_table.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "commands/csv_table.h"
#include "io/capture_metadata.h"

namespace blindcorner {
namespace {

constexpr std::string_view kIndex = "index";
constexpr std::string_view kDegrees = "yaw_deg";

/// The part of a column's name after the object's name and a dot, if it has these.
std::string_view component_of(std::string_view column) {
  const std::size_t dot = column.rfind('.');
  return dot == std::string_view::npos ? column : column.substr(dot + 1);
}

/// What a column of true values holds.
struct TruthColumn {
  std::string name;  ///< of the unknown: yaw_rad also of a column in degrees
  double unit = 1;   ///< factor to the unknown's unit: radians per degree for degrees
};

/// "yaw_deg" and "front.yaw_deg" are a yaw in degrees. Any other name stands for itself.
TruthColumn truth_column(const std::string& header) {
  if (component_of(header) != kDegrees) return {header};
  return {header.substr(0, header.size() - kDegrees.size()) + "yaw_rad", kDegree};
}

/// Columns of a table that are read, by their place in it.
std::map<std::size_t, TruthColumn> read_columns(
    const std::string& path, const std::vector<std::string>& header,
    const std::function<bool(const std::string& name)>& is_known) {
  std::map<std::size_t, TruthColumn> columns;
  std::map<std::string, std::string> headers;  // by the name of what they hold
  for (std::size_t c = 0; c < header.size(); ++c) {
    TruthColumn column = truth_column(header[c]);
    if (column.name != kIndex && !is_known(column.name)) continue;
    const auto [other, first] = headers.emplace(column.name, header[c]);
    if (!first) {
      throw Error(path, "found columns \"" + other->second + "\" and \"" + header[c] +
                            "\", accepted: " + column.name + " once");
    }
    columns.emplace(c, std::move(column));
  }
  return columns;
}

double table_number(const std::string& cell, const std::string& where) {
  double value = 0;
  const auto [end, code] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (code != std::errc() || end != cell.data() + cell.size() || !std::isfinite(value)) {
    throw Error(where, "found \"" + cell + "\", accepted: a number, or nothing");
  }
  return value;
}

std::size_t place_of(const std::string& cell, const std::string& where) {
  int place = -1;
  const auto [end, code] = std::from_chars(cell.data(), cell.data() + cell.size(), place);
  if (code != std::errc() || end != cell.data() + cell.size() || place < 0) {
    throw Error(where, "found \"" + cell + "\", accepted: a capture's place, from 0");
  }
  return static_cast<std::size_t>(place);
}

}  // namespace

TruthTable read_truth_table(const std::string& path,
                            const std::function<bool(const std::string& name)>& is_known) {
  const CsvTable csv = read_csv_table(path);
  const std::map<std::size_t, TruthColumn> columns = read_columns(path, csv.header, is_known);
  TruthTable table;
  for (std::size_t r = 0; r < csv.rows.size(); ++r) {
    std::size_t place = r;
    std::map<std::string, double> truth;
    for (const auto& [c, column] : columns) {
      const std::string& cell = csv.rows[r][c];
      const std::string where = csv_place(path, r) + ": " + csv.header[c];
      if (column.name == kIndex) {
        table.indexed = true;
        place = place_of(cell, where);
      } else if (!cell.empty()) {
        truth[column.name] = column.unit * table_number(cell, where);
      }
    }
    if (!table.truths.emplace(place, std::move(truth)).second) {
      throw Error(csv_place(path, r) + ": index",
                  "found " + std::to_string(place) + " again, accepted: each capture once");
    }
  }
  return table;
}

void add_truths(const std::string& path, std::vector<Capture>& captures) {
  const TruthTable table = read_truth_table(path, [&](const std::string& name) {
    if (is_component(name)) return true;
    throw Error(path, "found column \"" + name +
                          "\", accepted: index, x_m, y_m, z_m, yaw_deg, yaw_rad, size, the last "
                          "six also as NAME.x_m");
  });
  if (!table.indexed && table.truths.size() != captures.size()) {
    throw Error(path, "found " + std::to_string(table.truths.size()) +
                          " rows, accepted: " + std::to_string(captures.size()) +
                          ", one for each capture, or a column index");
  }
  for (const auto& [place, truth] : table.truths) {
    if (place >= captures.size()) {
      throw Error(path + ": index", "found " + std::to_string(place) + ", accepted: 0 to " +
                                        std::to_string(captures.size() - 1));
    }
    captures[place].truth = truth;
  }
}

}  // namespace blindcorner
