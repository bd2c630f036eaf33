// SPDX-License-Identifier: Apache-2.0
#include "commands/truth_table.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "commands/csv_table.h"

namespace blindcorner {
namespace {

constexpr std::string_view kIndex = "index";
constexpr std::string_view kDegrees = "yaw_deg";
constexpr std::array<std::string_view, 6> kComponents{"x_m",     "y_m",    "z_m",
                                                      "yaw_rad", kDegrees, "size"};

/// The name's part behind the object's, if it has one.
std::string_view component_of(std::string_view column) {
  const std::size_t dot = column.rfind('.');
  return dot == std::string_view::npos ? column : column.substr(dot + 1);
}

void check_header(const std::string& path, const std::vector<std::string>& header) {
  for (std::size_t c = 0; c < header.size(); ++c) {
    const bool known =
        header[c] == kIndex || std::ranges::count(kComponents, component_of(header[c])) > 0;
    if (!known) {
      throw Error(path, "found column \"" + header[c] +
                            "\", accepted: index, x_m, y_m, z_m, yaw_deg, yaw_rad, size, the last "
                            "six also as NAME.x_m");
    }
    if (std::count(header.begin(), header.end(), header[c]) > 1) {
      throw Error(path, "found column \"" + header[c] + "\" twice, accepted: once");
    }
  }
}

double table_number(const std::string& cell, const std::string& where) {
  double value = 0;
  const auto [end, code] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (code != std::errc() || end != cell.data() + cell.size() || !std::isfinite(value)) {
    throw Error(where, "found \"" + cell + "\", accepted: a number, or nothing");
  }
  return value;
}

}  // namespace

TruthColumn truth_column(const std::string& header) {
  if (component_of(header) != kDegrees) return {header};
  return {header.substr(0, header.size() - kDegrees.size()) + "yaw_rad", kDegree};
}

void add_truths(const std::string& path, std::vector<Capture>& captures) {
  const CsvTable table = read_csv_table(path);
  check_header(path, table.header);
  const bool indexed = std::ranges::count(table.header, kIndex) > 0;
  if (!indexed && table.rows.size() != captures.size()) {
    throw Error(path, "found " + std::to_string(table.rows.size()) +
                          " rows, accepted: " + std::to_string(captures.size()) +
                          ", one for each capture, or a column index");
  }
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    const std::string where = csv_place(path, r);
    std::map<std::string, double> truth;
    double place = static_cast<double>(r);
    for (std::size_t c = 0; c < table.header.size(); ++c) {
      const std::string& cell = table.rows[r][c];
      const std::string& header = table.header[c];
      if (cell.empty() && header != kIndex) continue;
      const double value = table_number(cell, where + ": " + header);
      if (header == kIndex) {
        place = value;
        continue;
      }
      const TruthColumn column = truth_column(header);
      truth[column.name] = column.unit * value;
    }
    if (place < 0 || place >= static_cast<double>(captures.size()) || place != std::floor(place)) {
      throw Error(where + ": index", "found " + std::to_string(place) + ", accepted: 0 to " +
                                         std::to_string(captures.size() - 1));
    }
    captures[static_cast<std::size_t>(place)].truth = std::move(truth);
  }
}

}  // namespace blindcorner
