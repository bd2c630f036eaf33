// SPDX-License-Identifier: Apache-2.0
#include "report/table.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "report/formatted.h"
#include "report/html.h"

namespace blindcorner {
namespace {

bool told(const TableCell& cell) {
  return !cell.is_null() && !(cell.is_number_float() && !std::isfinite(cell.get<double>()));
}

/// What a reader sees, without padding.
std::string shown(const TableField& field) {
  const TableCell& cell = field.value;
  if (!told(cell)) return "-";
  if (cell.is_string()) return cell.get<std::string>();
  if (cell.is_number_integer()) return cell.dump();
  if (cell.is_boolean()) return cell.get<bool>() ? "yes" : "no";
  const std::string text = formatted(field.pattern, field.unit * cell.get<double>());
  return text.substr(text.find_first_not_of(' '));
}

/// The text padded to the width of its column: that of the pattern or of the heading, whichever is
/// larger.
std::string padded(const TableField& field, const std::string& text) {
  const bool left = field.pattern[1] == '-';
  const int width = std::max(std::atoi(field.pattern + (left ? 2 : 1)),
                             static_cast<int>(std::strlen(field.heading)));
  return formatted(left ? "%-*s" : "%*s", width, text.c_str());
}

/// Texts of the fields that readers see, side by side.
template <class Text>
std::string line_of(const TableRow& row, const Text& text_of) {
  std::string line;
  for (const TableField& field : row.fields) {
    if (*field.heading == '\0') continue;
    line += (line.empty() ? "" : " ") + padded(field, text_of(field));
  }
  return line.erase(line.find_last_not_of(' ') + 1) + "\n";
}

std::string csv_cell(const TableField& field) {
  const TableCell& cell = field.value;
  if (!told(cell)) return {};
  if (cell.is_boolean()) return cell.get<bool>() ? "1" : "0";
  if (cell.is_number_float()) return formatted("%.6g", cell.get<double>());
  if (!cell.is_string()) return cell.dump();
  std::string text = cell.get<std::string>();
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + '"';
}

template <class Text>
std::string csv_line(const TableRow& row, const Text& text_of) {
  std::string line;
  for (const TableField& field : row.fields) {
    if (*field.key != '\0') line += "," + std::string(text_of(field));
  }
  return line.substr(1) + "\n";
}

}  // namespace

std::string table_head(const TableRow& row) {
  return line_of(row, [](const TableField& field) { return field.heading; });
}

std::string table_line(const TableRow& row) { return line_of(row, shown); }

std::string table_text(const std::vector<TableRow>& rows) {
  std::string text;
  for (const TableRow& row : rows) text += (text.empty() ? table_head(row) : "") + table_line(row);
  return text;
}

std::string table_html(const std::vector<TableRow>& rows) {
  if (rows.empty()) return {};
  std::string html = "<table><tr>";
  for (const TableField& field : rows.front().fields) {
    if (*field.heading != '\0') html += "<th>" + html_safe(field.heading);
  }
  for (const TableRow& row : rows) {
    html += "</tr>\n<tr";
    if (row.fails) html += " style=\"background:var(--alarm);font-weight:600\"";
    html += ">";
    for (const TableField& field : row.fields) {
      if (*field.heading != '\0') html += "<td>" + html_safe(shown(field));
    }
  }
  return html + "</tr>\n</table>\n";
}

std::string table_csv(const std::vector<TableRow>& rows) {
  std::string csv;
  for (const TableRow& row : rows) {
    if (csv.empty()) csv = csv_line(row, [](const TableField& field) { return field.key; });
    csv += csv_line(row, csv_cell);
  }
  return csv;
}

TableCell table_json(const TableRow& row) {
  TableCell json = TableCell::object();
  for (const TableField& f : row.fields) {
    if (*f.key != '\0') json[f.key] = told(f.value) ? f.value : TableCell(nullptr);
  }
  return json;
}

TableCell table_json(const std::vector<TableRow>& rows) {
  TableCell list = TableCell::array();
  for (const TableRow& row : rows) list.push_back(table_json(row));
  return list;
}

}  // namespace blindcorner
