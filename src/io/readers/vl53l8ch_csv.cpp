// SPDX-License-Identifier: Apache-2.0
/// Tables of ST's VL53L8CH evaluation kit: `data_*.csv` beside `info_*.csv`, with one row per frame
/// and columns `cnh__hist_bin_<bin>_a<zone>` among others.
#include <algorithm>
#include <filesystem>
#include <map>

#include "blindcorner/forward/error.h"
#include "io/readers/arrays.h"
#include "io/readers/capture_reader.h"
#include "io/readers/text_lines.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPrefix = "cnh__hist_bin_";

/// Bin and zone of a column's name.
std::optional<std::pair<int, int>> bin_and_zone(std::string_view name) {
  if (!name.starts_with(kPrefix)) return std::nullopt;
  name.remove_prefix(kPrefix.size());
  const std::size_t middle = name.find("_a");
  if (middle == std::string_view::npos) return std::nullopt;
  const auto bin = whole_number_of(name.substr(0, middle));
  const auto zone = whole_number_of(name.substr(middle + 2));
  constexpr long kMost = 1 << 12;
  if (!bin || !zone || *bin < 0 || *zone < 0 || *bin >= kMost || *zone >= kMost) {
    return std::nullopt;
  }
  return std::pair(static_cast<int>(*bin), static_cast<int>(*zone));
}

/// Which column holds which bin.
struct Heading {
  char separator = ',';
  std::size_t columns = 0;
  std::map<std::pair<int, int>, std::size_t> place;  ///< (zone, bin) -> column
  int zones = 0, bins = 0;
};

Heading read_heading(const TextLine& line, const std::string& where) {
  Heading heading;
  heading.separator = separator_of(line.text);
  const std::vector<std::string_view> names = fields_of(line.text, heading.separator);
  heading.columns = names.size();
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto found = bin_and_zone(names[i]);
    if (!found) continue;
    const auto [bin, zone] = *found;
    if (!heading.place.emplace(std::pair(zone, bin), i).second) {
      throw Error(where, "column " + std::string(names[i]) + " comes twice");
    }
    heading.zones = std::max(heading.zones, zone + 1);
    heading.bins = std::max(heading.bins, bin + 1);
  }
  for (int zone = 0; zone < heading.zones; ++zone) {
    for (int bin = 0; bin < heading.bins; ++bin) {
      if (heading.place.contains({zone, bin})) continue;
      throw Error(where, "column " + std::string(kPrefix) + std::to_string(bin) + "_a" +
                             std::to_string(zone) + " is missing, accepted: all bins of " +
                             std::to_string(heading.zones) + " zones");
    }
  }
  return heading;
}

bool is_heading(std::string_view line) { return line.find(kPrefix) != std::string_view::npos; }

/// Numbers of a row. Throws Error naming `where` for a row that is cut or damaged.
HistogramCube read_row(const TextLine& line, const Heading& heading, int rows, int columns,
                       const std::string& where) {
  const std::vector<std::string_view> fields = fields_of(line.text, heading.separator);
  if (fields.size() < heading.columns) {
    throw Error(where, "has " + std::to_string(fields.size()) + " of " +
                           std::to_string(heading.columns) + " columns");
  }
  HistogramCube counts(rows, columns, heading.bins);
  for (const auto& [place, column] : heading.place) {
    const auto value = number_of(fields[column], heading.separator != ',');
    if (!value) {
      throw Error(where, "bin " + std::to_string(place.second) + " of zone " +
                             std::to_string(place.first) + " is '" + std::string(fields[column]) +
                             "', accepted a number");
    }
    counts.zone(place.first)[place.second] = *value;
  }
  return counts;
}

std::vector<std::string> tables_in(const ImportSource& source) {
  std::vector<std::string> files;
  std::error_code error;
  for (fs::directory_iterator it(source.path(), error), end; !error && it != end;
       it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.starts_with("data_") && name.ends_with(".csv")) files.push_back(it->path().string());
  }
  if (error) throw Error(source.path(), "cannot be listed: " + error.message());
  std::sort(files.begin(), files.end());
  return files;
}

bool recognise(const ImportSource& source) {
  if (source.is_folder()) return !tables_in(source).empty();
  return is_heading(source.beginning());
}

CaptureFile read(const ImportSource& source, const ImportOptions& options, ImportNotes& notes) {
  const std::string& path = source.path();
  const std::vector<TextLine> lines = lines_of(source.bytes());
  const auto first =
      std::ranges::find_if(lines, [](const TextLine& line) { return is_heading(line.text); });
  if (first == lines.end()) {
    throw Error(path, "has no columns " + std::string(kPrefix) + "<bin>_a<zone>");
  }
  const auto where = [&](const TextLine& line) { return line_place(path, line.number); };
  Heading heading = read_heading(*first, where(*first));
  const auto [rows, columns] =
      zone_layout(static_cast<std::size_t>(heading.zones), options, path, notes);
  CaptureFile file;
  file.sensor = "vl53l8ch";
  for (auto line = first + 1; line != lines.end(); ++line) {
    if (line->text.empty()) continue;
    try {
      if (is_heading(line->text)) {  // the kit's program started again into the same file
        const Heading next = read_heading(*line, where(*line));
        if (next.zones != heading.zones || next.bins != heading.bins) {
          throw Error(where(*line), "another recording of " + std::to_string(next.zones) +
                                        " zones of " + std::to_string(next.bins) +
                                        " bins begins here, accepted: as the first");
        }
        heading = next;
        continue;
      }
      Capture capture;
      capture.counts = read_row(*line, heading, rows, columns, where(*line));
      file.captures.push_back(std::move(capture));
    } catch (const Error& damage) {
      notes.push_back(std::string(damage.what()) + "; the row is left out");
    }
  }
  if (file.captures.empty()) throw Error(path, "holds no whole row of numbers");
  return file;
}

}  // namespace

CaptureReader vl53l8ch_csv_reader() {
  return {.name = "vl53l8ch_csv",
          .recognises =
              "table of ST's VL53L8CH kit, columns cnh__hist_bin_<bin>_a<zone>, or a folder "
              "with data_*.csv",
          .assumes = "zones row by row in a square unless --rows and --columns say",
          .options = {"rows"},
          .recognise = recognise,
          .read = read,
          .files = tables_in};
}

}  // namespace blindcorner
