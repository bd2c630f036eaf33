// SPDX-License-Identifier: Apache-2.0
/// Tables for the terminal, for pages, as CSV and as JSON, from rows that say each value once.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace blindcorner {

/// A number, a text, a truth value, or null where there is nothing to tell.
using TableCell = nlohmann::ordered_json;

/// One value of a row, and the column that it stands in.
struct TableField {
  const char* key;      ///< in CSV and JSON; empty: for readers alone
  const char* heading;  ///< on the terminal and on pages; empty: for programs alone
  /// A std::printf pattern with a width: "%9.3f" or "%5d" for numbers, "%-12s" for texts.
  const char* pattern;
  TableCell value;
  double unit = 1;  ///< factor from the value to what readers see
};

struct TableRow {
  std::vector<TableField> fields;  ///< the same columns in all rows of a table
  bool fails = false;              ///< marked on pages
};

/// The headings of a row's columns, and its values; readers see "-" where nothing is told.
std::string table_head(const TableRow& row);
std::string table_line(const TableRow& row);
/// Head and lines. Without rows this text, the HTML and the CSV are empty.
std::string table_text(const std::vector<TableRow>& rows);
std::string table_html(const std::vector<TableRow>& rows);
/// Numbers with six digits, truth values as 1 and 0, an empty cell where nothing is told.
std::string table_csv(const std::vector<TableRow>& rows);
/// A row as an object by the fields' keys, and a list of such objects.
TableCell table_json(const TableRow& row);
TableCell table_json(const std::vector<TableRow>& rows);

}  // namespace blindcorner
