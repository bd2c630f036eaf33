// SPDX-License-Identifier: Apache-2.0
#include "commands/printout.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "commands/csv_table.h"
#include "io/file_bytes.h"

namespace blindcorner {
namespace {

using Json = nlohmann::ordered_json;

/// A number where the cell is one that JSON can hold, null where it is empty or a number that is
/// not finite, else text.
Json cell_json(const std::string& cell) {
  if (cell.empty()) return nullptr;
  char* end = nullptr;
  const double value = std::strtod(cell.c_str(), &end);
  if (*end != '\0') return cell;
  if (!std::isfinite(value)) return nullptr;
  return Json::parse(cell, nullptr, false).is_number() ? Json::parse(cell) : Json(value);
}

Json rows_json(const CsvTable& table) {
  Json rows = Json::array();
  for (const auto& cells : table.rows) {
    Json row = Json::object();
    for (std::size_t i = 0; i < cells.size(); ++i) row[table.header[i]] = cell_json(cells[i]);
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace

void Printout::add_option(CLI::App& command, const std::string& document) {
  command.add_flag("--json", json_, "print " + document + " as JSON, not a table");
}

void Printout::text(const char* pattern, ...) const {
  if (json_) return;
  std::va_list arguments;
  va_start(arguments, pattern);
  std::vprintf(pattern, arguments);
  va_end(arguments);
  std::fflush(stdout);
}

void Printout::document(const std::string& json) const {
  if (!json_) return;
  std::fputs(json.c_str(), stdout);
  if (!json.ends_with('\n')) std::fputc('\n', stdout);
}

void Printout::file(const std::string& path) const {
  if (!json_) return;
  const bool table = path.ends_with(".csv");
  document(table
               ? rows_json(read_csv_table(path)).dump(1, ' ', false, Json::error_handler_t::replace)
               : read_bytes(path));
}

}  // namespace blindcorner
