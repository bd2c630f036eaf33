// SPDX-License-Identifier: Apache-2.0
#include "io/readers/vl53l8ch_log.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <sstream>

#include "blindcorner/forward/error.h"
#include "io/readers/capture_reader.h"
#include "io/serial_log.h"

namespace blindcorner {
namespace {

/// Bins and ambient light are printed in thousandths.
constexpr double kThousandth = 1e-3;
/// Width of a bin if the firmware does not sum bins, s.
constexpr double kBinWidth = 250e-12;
/// Zone, ambient light and distance stand before the bins.
constexpr std::size_t kLeading = 3;

std::string trimmed(std::string line) {
  while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
  return line;
}

/// Whole numbers of a line; nothing when there is anything else.
std::optional<std::vector<long>> whole_numbers(const std::string& line) {
  std::vector<long> values;
  std::istringstream stream(line);
  for (std::string word; stream >> word;) {
    std::size_t used = 0;
    try {
      values.push_back(std::stol(word, &used));
    } catch (const std::exception&) {
      return std::nullopt;
    }
    if (used != word.size()) return std::nullopt;
  }
  return values;
}

struct Frame {
  int line = 0;  ///< of its `D`
  std::string damage;
  std::map<long, std::vector<double>> zones;
};

bool begins_frame(std::string_view line) { return line == "D"; }

/// Whether a line may be a zone's.
bool is_zone_line(std::string_view line) {
  return !line.empty() && (line[0] == '-' || (line[0] >= '0' && line[0] <= '9'));
}

void add_line(Frame& frame, const std::string& text, int line) {
  const auto damaged = [&](const std::string& what) {
    if (frame.damage.empty()) frame.damage = "line " + std::to_string(line) + ": " + what;
  };
  const auto values = whole_numbers(text);
  if (!values || values->size() <= kLeading) return damaged("is no histogram");
  std::vector<double> bins;
  for (std::size_t i = kLeading; i < values->size(); ++i) {
    bins.push_back(kThousandth * static_cast<double>((*values)[i]));
  }
  if (!frame.zones.emplace((*values)[0], std::move(bins)).second) {
    damaged("zone " + std::to_string((*values)[0]) + " comes twice");
  }
}

/// Notes what is missing or uneven in a frame that should have so many zones and bins.
void check_frame(Frame& frame, std::size_t zones, std::size_t bins) {
  if (!frame.damage.empty()) return;
  if (frame.zones.size() != zones) {
    frame.damage =
        "has " + std::to_string(frame.zones.size()) + " of " + std::to_string(zones) + " zones";
    return;
  }
  long expected = 0;
  for (const auto& [zone, row] : frame.zones) {
    if (zone != expected) {
      frame.damage = "zone " + std::to_string(expected) + " is missing";
      return;
    }
    if (row.size() != bins) {
      frame.damage = "zone " + std::to_string(zone) + " has " + std::to_string(row.size()) +
                     " of " + std::to_string(bins) + " bins";
      return;
    }
    ++expected;
  }
}

/// The capture of a frame that was checked.
Capture capture_of(const Frame& frame, int rows, int columns) {
  Capture capture;
  const auto bins = static_cast<int>(frame.zones.begin()->second.size());
  capture.counts = HistogramCube(rows, columns, bins);
  for (const auto& [zone, row] : frame.zones) {
    std::ranges::copy(row, capture.counts.zone(static_cast<int>(zone)));
  }
  return capture;
}

std::vector<Frame> frames_of(const std::string& text) {
  std::vector<Frame> frames;
  std::istringstream stream(text);
  int number = 0;
  for (std::string raw; std::getline(stream, raw);) {
    ++number;
    raw = trimmed(raw);
    const std::string line(without_time_stamp(raw));
    if (begins_frame(line)) {
      frames.push_back({number, "", {}});
    } else if (!frames.empty() && is_zone_line(line)) {
      add_line(frames.back(), line, number);
    }
  }
  return frames;
}

}  // namespace

bool is_vl53l8ch_log(const std::string& text) {
  for (const Frame& frame : frames_of(text)) {
    if (!frame.zones.empty()) return true;
  }
  return false;
}

std::vector<Capture> parse_vl53l8ch_log(const std::string& text, const std::string& path,
                                        const ImportOptions& options,
                                        std::vector<std::string>& warnings) {
  std::vector<Frame> frames = frames_of(text);
  // Finds the usual size of a frame: the log may begin and end within one.
  std::map<std::pair<std::size_t, std::size_t>, int> sizes;
  for (const Frame& frame : frames) {
    const auto as_long = [&](const auto& zone) {
      return zone.second.size() == frame.zones.begin()->second.size();
    };
    if (frame.damage.empty() && !frame.zones.empty() && std::ranges::all_of(frame.zones, as_long)) {
      ++sizes[{frame.zones.size(), frame.zones.begin()->second.size()}];
    }
  }
  if (sizes.empty()) throw Error(path, "holds no whole frame (a line D, then a line per zone)");
  auto usual = sizes.begin();
  for (auto it = sizes.begin(); it != sizes.end(); ++it) {
    if (it->second > usual->second || (it->second == usual->second && it->first > usual->first)) {
      usual = it;
    }
  }
  const auto [zones, bins] = usual->first;
  int rows = options.rows;
  int columns = options.columns;
  if (rows == 0) {
    rows = columns = static_cast<int>(std::lround(std::sqrt(static_cast<double>(zones))));
  }
  if (static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns) != zones) {
    throw Error(path, "has " + std::to_string(zones) +
                          " zones in a frame: rows and columns have to be stated");
  }
  std::vector<Capture> captures;
  for (Frame& frame : frames) {
    check_frame(frame, zones, bins);
    if (!frame.damage.empty()) {
      warnings.push_back(path + ": frame of line " + std::to_string(frame.line) +
                         " left out: " + frame.damage);
      continue;
    }
    captures.push_back(capture_of(frame, rows, columns));
  }
  if (captures.empty()) throw Error(path, "holds no whole frame (a line D, then a line per zone)");
  return captures;
}

namespace {

bool recognise(const ImportSource& source) { return is_vl53l8ch_log(source.beginning()); }

CaptureFile read(const ImportSource& source, const ImportOptions& options, ImportNotes& notes) {
  CaptureFile file;
  file.captures = parse_vl53l8ch_log(source.bytes(), source.path(), options, notes);
  file.sensor = "vl53l8ch";
  file.bin_width = kBinWidth;
  return file;
}

bool recognise_line(std::string_view line) { return begins_frame(without_time_stamp(line)); }

/// A stream of the same lines. A frame is complete with its last zone.
class LogStream : public LineReader {
 public:
  explicit LogStream(LineOptions options) : options_(std::move(options)) {}

  void add(const TextLine& line, LineYield& yield) override {
    const std::string text(without_time_stamp(line.text));
    if (begins_frame(text)) return begin(line, yield);
    if (!is_zone_line(text)) return;
    if (!open_) return add_stray(line, yield);
    if (text == last_) {
      note(line, LineFault::repeated_line, "comes twice; the second is left out", yield);
      return;
    }
    last_ = text;
    add_line(frame_, text, line.number);
    if (!frame_.damage.empty()) {
      open_ = false;
      yield.notes.push_back({LineFault::damaged_line,
                             options_.path + ": " + frame_.damage + "; the line is left out"});
      leave_out(yield);
    } else if (frame_.zones.size() == zones()) {
      finish(yield);
    }
  }

  void interrupt(LineYield& yield) override {
    if (open_ && !frame_.zones.empty()) {
      frame_.damage = "the input was interrupted within it";
      leave_out(yield);
    }
    open_ = false;
    strays_told_ = true;  // the next lines may be the rest of a frame
  }

 private:
  std::size_t zones() const { return static_cast<std::size_t>(options_.rows * options_.columns); }

  void note(const TextLine& line, LineFault fault, const std::string& text, LineYield& yield) {
    yield.notes.push_back({fault, line_place(options_.path, line.number) + ": " + text});
  }
  void leave_out(LineYield& yield) {
    yield.notes.push_back({LineFault::incomplete_capture, options_.path + ": frame of line " +
                                                              std::to_string(frame_.line) +
                                                              " left out: " + frame_.damage});
    strays_told_ = true;
  }

  void begin(const TextLine& line, LineYield& yield) {
    if (open_ && !frame_.zones.empty()) {
      check_frame(frame_, zones(), static_cast<std::size_t>(options_.bins));
      leave_out(yield);
    }
    frame_ = {line.number, "", {}};
    open_ = true;
    strays_told_ = false;
    last_.clear();
  }

  /// Handles a zone's line after a whole frame, or before any frame: a line D is missing, or the
  /// beginning of a frame.
  void add_stray(const TextLine& line, LineYield& yield) {
    if (text_of_last(line)) {
      note(line, LineFault::repeated_line, "comes twice; the second is left out", yield);
    } else if (!strays_told_) {
      note(line, LineFault::incomplete_capture, "a zone without a line D before; left out", yield);
      strays_told_ = true;
    }
  }
  bool text_of_last(const TextLine& line) const {
    return !last_.empty() && without_time_stamp(line.text) == last_;
  }

  void finish(LineYield& yield) {
    open_ = false;
    check_frame(frame_, zones(), static_cast<std::size_t>(options_.bins));
    if (!frame_.damage.empty()) return leave_out(yield);
    yield.captures.push_back(capture_of(frame_, options_.rows, options_.columns));
  }

  LineOptions options_;
  Frame frame_;
  std::string last_;  ///< line of a zone
  bool open_ = false;
  bool strays_told_ = false;
};

std::string print(const Capture& capture, const std::string& where) {
  constexpr double kMost =
      2e9;  // thousandths of a count, as the firmware's whole numbers hold them
  const HistogramCube& counts = capture.counts;
  std::string log = "D\n";
  for (int zone = 0; zone < counts.zones(); ++zone) {
    log += std::to_string(zone) + " 0 0";
    for (int bin = 0; bin < counts.bins; ++bin) {
      const double thousandths = std::round(counts.zone(zone)[bin] / kThousandth);
      if (!(std::abs(thousandths) <= kMost)) {
        throw Error(where, "found a count of " + std::to_string(counts.zone(zone)[bin]) +
                               ", accepted: -2000000 to 2000000");
      }
      log += " " + std::to_string(static_cast<long>(thousandths));
    }
    log += "\n";
  }
  return log;
}

}  // namespace

CaptureReader vl53l8ch_log_reader() {
  return {.name = "vl53l8ch",
          .recognises = "serial log of VL53L8CH firmware, a line D, then a line each zone",
          .assumes = "bins of 250 ps, zones row by row in a square unless --rows and --columns say",
          .options = {"rows"},
          .recognise = recognise,
          .read = read,
          .recognise_line = recognise_line,
          .lines = stream_of<LogStream>,
          .print = print};
}

}  // namespace blindcorner
