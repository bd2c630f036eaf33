// SPDX-License-Identifier: Apache-2.0
/// Newline-delimited JSON, one object per capture: `{"counts": [[bin 0, bin 1, ...], ...]}` with a
/// list for each zone, row by row, or for each row a list of such lists. `exposures` and
/// `dispersion` may stand beside it. Programs that talk to a sensor of their own can print it.
#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "blindcorner/forward/error.h"
#include "io/readers/arrays.h"
#include "io/readers/capture_reader.h"
#include "io/readers/text_lines.h"

namespace blindcorner {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kMostZones = 64UL * 64;
constexpr std::size_t kMostBins = 1 << 16;

/// The zones of `counts`, which come in one list or in a list per row.
std::vector<const Json*> zones_of(const Json& counts) {
  std::vector<const Json*> zones;
  const bool in_rows = counts.at(0).at(0).is_array();
  for (const Json& outer : counts) {
    if (!in_rows) {
      zones.push_back(&outer);
      continue;
    }
    for (const Json& inner : outer) zones.push_back(&inner);
    if (outer.size() != counts[0].size()) throw Error("counts", "rows of unequal length");
  }
  return zones;
}

/// The capture that an object holds. Throws Json::exception or Error if it holds none. `stated`:
/// the number of zones must be that of the options' rows and columns. Otherwise another number gets
/// the rows in which `counts` comes, or else those of a square; those who know the scene refuse it.
Capture capture_of(const Json& object, const ImportOptions& options, bool stated,
                   const std::string& where) {
  const Json& counts = object.at("counts");
  const std::vector<const Json*> zones = zones_of(counts);
  const std::size_t bins = zones.front()->size();
  if (zones.size() > kMostZones || bins == 0 || bins > kMostBins) {
    throw Error("counts", "found " + std::to_string(zones.size()) + " zones of " +
                              std::to_string(bins) + " bins, accepted: up to 4096 of 1 to 65536");
  }
  ImportOptions layout = options;
  if (!stated && static_cast<std::size_t>(options.rows * options.columns) != zones.size()) {
    layout.rows = layout.columns = 0;
  }
  if (layout.rows == 0 && counts.size() != zones.size()) {
    layout.rows = static_cast<int>(counts.size());
    layout.columns = static_cast<int>(zones.size() / counts.size());
  }
  ImportNotes square_is_the_rule;
  const auto [rows, columns] = zone_layout(zones.size(), layout, where, square_is_the_rule);
  Capture capture;
  capture.counts = HistogramCube(rows, columns, static_cast<int>(bins));
  double* next = capture.counts.values.data();
  for (const Json* zone : zones) {
    if (zone->size() != bins) throw Error("counts", "unequal numbers of bins");
    for (const Json& count : *zone) *next++ = count.get<double>();
  }
  capture.exposures = object.value("exposures", 1.0);
  if (!(capture.exposures > 0)) throw Error("exposures", "accepted: above 0");
  if (object.contains("dispersion")) {
    capture.dispersion = object["dispersion"].get<double>();
    if (!(*capture.dispersion > 0)) throw Error("dispersion", "accepted: above 0");
  }
  return capture;
}

bool recognise_line(std::string_view line) {
  return line.starts_with('{') && line.find("\"counts\"") != std::string_view::npos;
}

bool recognise(const ImportSource& source) {
  const std::string& text = source.beginning();
  return recognise_line(std::string_view(text).substr(0, text.find('\n')));
}

CaptureFile read(const ImportSource& source, const ImportOptions& options, ImportNotes& notes) {
  CaptureFile file;
  for (const TextLine& line : lines_of(source.bytes())) {
    if (!line.text.starts_with('{')) continue;
    const std::string where = line_place(source.path(), line.number);
    try {
      Capture capture = capture_of(Json::parse(line.text), options, true, where);
      const HistogramCube& first =
          file.captures.empty() ? capture.counts : file.captures.front().counts;
      if (capture.counts.values.size() != first.values.size() ||
          capture.counts.rows != first.rows) {
        throw Error("counts", "other zones or bins than those before");
      }
      file.captures.push_back(std::move(capture));
    } catch (const std::exception& damage) {
      notes.push_back(where + ": is damaged (" + damage.what() + "); left out");
    }
  }
  if (file.captures.empty()) throw Error(source.path(), "holds no whole line with counts");
  return file;
}

/// A stream of the same lines.
class LineStream : public LineReader {
 public:
  explicit LineStream(const LineOptions& options) : path_(options.path) {
    zones_.rows = options.rows;
    zones_.columns = options.columns;
  }

  void add(const TextLine& line, LineYield& yield) override {
    if (!line.text.starts_with('{')) return;
    const std::string where = line_place(path_, line.number);
    if (line.text == last_) {
      yield.notes.push_back(
          {LineFault::repeated_line, where + ": comes twice; the second is left out"});
      return;
    }
    last_ = line.text;
    try {
      yield.captures.push_back(capture_of(Json::parse(line.text), zones_, false, where));
    } catch (const std::exception& damage) {
      yield.notes.push_back({LineFault::damaged_line,
                             where + ": is damaged (" + damage.what() + "); the line is left out"});
    }
  }

  void interrupt(LineYield&) override { last_.clear(); }

 private:
  std::string path_;
  ImportOptions zones_;
  std::string last_;
};

std::string print(const Capture& capture, const std::string&) {
  Json zones = Json::array();
  for (int zone = 0; zone < capture.counts.zones(); ++zone) {
    const double* bins = capture.counts.zone(zone);
    zones.push_back(std::vector<double>(bins, bins + capture.counts.bins));
  }
  Json object = {{"counts", std::move(zones)}};
  if (capture.exposures != 1.0) object["exposures"] = capture.exposures;
  if (capture.dispersion) object["dispersion"] = *capture.dispersion;
  return object.dump() + "\n";
}

}  // namespace

CaptureReader json_lines_reader() {
  return {.name = "json_lines",
          .recognises = "lines of JSON, {\"counts\": [[bin 0, bin 1, ...], ...]} each capture",
          .assumes = "zones row by row in a square unless --rows and --columns say",
          .options = {"rows"},
          .recognise = recognise,
          .read = read,
          .recognise_line = recognise_line,
          .lines = stream_of<LineStream>,
          .print = print};
}

}  // namespace blindcorner
