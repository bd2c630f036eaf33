// SPDX-License-Identifier: Apache-2.0
#include "commands/csv_table.h"

#include <algorithm>
#include <sstream>

#include "blindcorner/forward/error.h"
#include "io/file_bytes.h"

namespace blindcorner {
namespace {

std::vector<std::string> cells(const std::string& line) {
  std::vector<std::string> list;
  std::stringstream stream(line);
  for (std::string cell; std::getline(stream, cell, ',');) {
    cell.erase(0, std::min(cell.find_first_not_of(" \t\r\""), cell.size()));
    cell.erase(cell.find_last_not_of(" \t\r\"") + 1);
    list.push_back(cell);
  }
  if (line.ends_with(',')) list.emplace_back();  // which getline does not see
  return list;
}

}  // namespace

std::string csv_place(const std::string& path, std::size_t row) {
  return path + ": row " + std::to_string(row + 1);
}

CsvTable read_csv_table(const std::string& path) {
  std::istringstream file(read_bytes(path));
  CsvTable table;
  std::string line;
  std::getline(file, line);
  if (line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);  // a byte order mark
  table.header = cells(line);
  while (std::getline(file, line)) {
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    table.rows.push_back(cells(line));
    if (table.rows.back().size() != table.header.size()) {
      throw Error(csv_place(path, table.rows.size() - 1),
                  "has " + std::to_string(table.rows.back().size()) +
                      " cells, accepted: " + std::to_string(table.header.size()));
    }
  }
  return table;
}

}  // namespace blindcorner
