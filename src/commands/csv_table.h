// SPDX-License-Identifier: Apache-2.0
/// Tables of values separated by commas.
#pragma once

#include <string>
#include <vector>

namespace blindcorner {

/// Cells without the blanks and quotation marks around them. Every row is as long as the header.
struct CsvTable {
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;
};

/// Throws Error when the file cannot be read or a row has another number of cells than the header.
/// Empty lines are passed over.
CsvTable read_csv_table(const std::string& path);

/// Where a row stands, for messages: "path.csv: row 3".
std::string csv_place(const std::string& path, std::size_t row);

}  // namespace blindcorner
