// SPDX-License-Identifier: Apache-2.0
#include "io/readers/tmf8828_log.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "blindcorner/forward/error.h"
#include "io/readers/capture_reader.h"
#include "io/readers/text_lines.h"

namespace blindcorner {
namespace {

constexpr int kBins = 128;
constexpr int kChannels = 10;          ///< channels of one measurement, the reference included
constexpr int kLines = 3 * kChannels;  ///< lines of one measurement
constexpr std::size_t kFieldsBeforeBins = 3;
constexpr std::size_t kRawFields = kFieldsBeforeBins + kBins;

struct RawLine {
  int address = 0;
  int index = 0;
  std::array<std::uint8_t, kBins> bytes{};

  bool operator==(const RawLine&) const = default;
};

RawLine parse_raw_line(std::string_view line, const std::string& where) {
  const std::vector<std::string_view> fields = fields_of(line, ',');
  const auto value = [&](std::size_t field, int highest, const std::string& name) {
    const std::optional<long> number = whole_number_of(fields[field]);
    if (!number || *number < 0 || *number > highest) {
      throw Error(where, name + " is '" + std::string(fields[field]) +
                             "', accepted a whole number from 0 to " + std::to_string(highest));
    }
    return static_cast<int>(*number);
  };
  if (fields.size() != kRawFields) {
    throw Error(where, "a #Raw line has " + std::to_string(fields.size()) +
                           " fields, accepted 131: #Raw, address, index and 128 bytes");
  }
  RawLine raw;
  raw.address = value(1, 127, "the i2c address");
  raw.index = value(2, kLines - 1, "the index");
  for (std::size_t bin = 0; bin < kBins; ++bin) {
    raw.bytes[bin] = static_cast<std::uint8_t>(
        value(kFieldsBeforeBins + bin, 255, "byte " + std::to_string(bin)));
  }
  return raw;
}

using Report = std::function<void(LineFault, const std::string&)>;

/// Joins lines to measurements and measurements to captures. In a stream, it tells repeated lines
/// from missing lines, and it takes a gap to be shorter than a measurement.
class Assembler {
 public:
  Assembler(Tmf882xLayout layout, bool has_results, bool stream, std::string path, Report report)
      : layout_(layout),
        has_results_(has_results),
        stream_(stream),
        path_(std::move(path)),
        report_(std::move(report)),
        frame_(layout.side, layout.side, kBins) {}

  void add(const RawLine& raw, int line) {
    if (lost_) return;
    if (stream_ && raw == last_) {
      warn(line, "comes twice; the second is left out", LineFault::repeated_line);
      return;
    }
    last_ = raw;
    if (raw.index != expected_ && !bridge(line, raw.index)) lose(line, raw.index);
    if (raw.index != expected_) return;  // still waiting for the next measurement to begin
    if (raw.index == 0) counts_.fill(0.0);
    const double significance = raw.index < 10 ? 1.0 : raw.index < 20 ? 256.0 : 65536.0;
    const std::size_t channel = static_cast<std::size_t>(raw.index % 10);
    for (std::size_t bin = 0; bin < kBins; ++bin) {
      counts_[channel * kBins + bin] += significance * raw.bytes[bin];
    }
    begun_ = true;
    waiting_ = false;
    if (++expected_ == kLines) finish_measurement();
  }

  /// Adds a result of 8 x 8 mode. The lowest two bits of its number count pairs of measurements.
  void add_result(int number, int line) {
    if (layout_.side != 8) return;
    has_results_ = true;
    lost_ = false;
    if (expected_ != 0) lose(line, -1);
    const int next = 2 * (number % 4 + 1) % layout_.measurements;
    if (known_ && next == measurement_) return;
    if (known_ && begun_) {
      warn(line,
           "the result says that this is not where the frame was thought to be; the capture "
           "is left out",
           LineFault::incomplete_capture);
    }
    known_ = true;
    measurement_ = next;
    intact_ = next == 0;
  }

  /// The board has restarted: the next measurement is the first of a frame.
  void restart(int line) {
    if (begun_ && (expected_ != 0 || measurement_ != 0)) {
      warn(line, "the board started again within a capture, which is left out", LineFault::restart);
    } else if (stream_ && begun_) {
      warn(line, "the board started again", LineFault::restart);
    }
    expected_ = measurement_ = 0;
    begun_ = waiting_ = lost_ = false;
    known_ = intact_ = true;
  }

  /// The stream was interrupted.
  void interrupt() {
    if (begun_ && (expected_ != 0 || measurement_ != 0)) {
      report_(LineFault::incomplete_capture,
              path_ + ": was interrupted within a capture, which is left out");
    }
    expected_ = measurement_ = 0;
    begun_ = waiting_ = false;
    known_ = intact_ = layout_.measurements == 1;
    last_ = RawLine{};
  }

  /// Hands out the complete captures.
  std::vector<Capture> take() { return std::exchange(captures_, {}); }

  std::vector<Capture> finish(bool cut_off) {
    if (!lost_ && (cut_off || expected_ != 0 || (measurement_ != 0 && known_))) {
      report_(LineFault::incomplete_capture,
              path_ + ": the log ends within a capture, which is left out");
    }
    const bool ninth_used = layout_.channels == 9;
    if (!captures_.empty() && ninth_used != ninth_has_counts_) {
      report_(LineFault::assumption,
              path_ + ": channel 9 " +
                  (ninth_used ? "is empty, which suggests 4 x 4 or 8 x 8 zones, not 3 x 3"
                              : "holds counts, which suggests 3 x 3 zones"));
    }
    return std::move(captures_);
  }

 private:
  void warn(int line, const std::string& message, LineFault fault) {
    report_(fault, line_place(path_, line) + ": " + message);
  }

  /// Handles missing lines in a stream whose frames have several measurements without numbers. At
  /// most one measurement is taken to be missing. The frame is left out, and it is known where the
  /// next frame begins.
  bool bridge(int line, int found) {
    const bool numbered = layout_.measurements == 1 || (layout_.side == 8 && has_results_);
    if (!stream_ || numbered || !begun_ || !known_) return false;
    warn(line,
         "expected index " + std::to_string(expected_) + ", found " + std::to_string(found) +
             ": lines are missing; the capture is left out",
         LineFault::incomplete_capture);
    intact_ = false;
    if (found < expected_) {  // the end of the measurement is missing
      if (++measurement_ == layout_.measurements) {
        measurement_ = 0;
        intact_ = found == 0;
      }
    }
    expected_ = found;
    return true;
  }

  /// Lines are missing: forget the capture and wait for the beginning of another measurement.
  void lose(int line, int found) {
    if (!waiting_) {
      waiting_ = true;
      const std::string what = begun_ ? "expected index " + std::to_string(expected_) + ", found " +
                                            (found < 0 ? "a result" : std::to_string(found)) +
                                            ": lines are missing"
                                      : "the log begins within a measurement";
      if (layout_.measurements > 1 && !(layout_.side == 8 && has_results_)) {
        lost_ = true;
        warn(line,
             what +
                 ", so that it is unknown which zones the next measurement belongs to; "
                 "left out until the board starts again",
             LineFault::incomplete_capture);
      } else {
        warn(line, what + "; the capture is left out", LineFault::incomplete_capture);
      }
    }
    expected_ = 0;
    intact_ = layout_.measurements == 1;
    known_ = layout_.measurements == 1;
  }

  void finish_measurement() {
    expected_ = 0;
    for (int channel = 1; channel <= layout_.channels; ++channel) {
      const double* from = counts_.data() + channel * kBins;
      std::copy(from, from + kBins, frame_.zone(layout_.zone(measurement_, channel)));
    }
    const double* ninth = counts_.data() + 9 * kBins;
    for (int bin = 0; bin < kBins; ++bin) ninth_has_counts_ |= ninth[bin] > 0.0;
    if (!known_ || ++measurement_ < layout_.measurements) return;
    measurement_ = 0;
    if (intact_) {
      Capture capture;
      capture.counts = frame_;
      captures_.push_back(std::move(capture));
    }
    intact_ = true;
  }

  Tmf882xLayout layout_;
  bool has_results_;
  bool stream_;
  std::string path_;
  Report report_;

  std::array<double, kChannels * kBins> counts_{};  ///< counts of the current measurement
  HistogramCube frame_;
  RawLine last_;          ///< the previous line; used in a stream
  int expected_ = 0;      ///< index of the next line
  int measurement_ = 0;   ///< place of the current measurement in its frame
  bool begun_ = false;    ///< a line was accepted
  bool waiting_ = false;  ///< lines were lost, and none was accepted since
  bool lost_ = false;     ///< nothing tells where a frame begins
  bool known_ = true;     ///< `measurement_` can be believed
  bool intact_ = true;    ///< all measurements of the frame so far were seen
  bool ninth_has_counts_ = false;
  std::vector<Capture> captures_;
};

/// Decides which sensor's lines to use: those of the chosen one, or of the first one in the log.
class AddressFilter {
 public:
  AddressFilter(int wanted, Report report)
      : wanted_(wanted), fixed_(wanted != 0), report_(std::move(report)) {}

  bool accepts(int address, const std::string& where) {
    if (wanted_ == 0) wanted_ = address;
    if (address == wanted_) return true;
    if (!fixed_ && others_.insert(address).second) {
      report_(LineFault::other_lines,
              where + ": the lines of a sensor at i2c address " + std::to_string(address) +
                  " are left out, those of address " + std::to_string(wanted_) +
                  " are kept; --i2c-address chooses");
    }
    return false;
  }

 private:
  int wanted_;
  bool fixed_;
  Report report_;
  std::set<int> others_;
};

bool recognise(const ImportSource& source) {
  return source.beginning().find("#Raw,") != std::string::npos;
}

/// Whether the line is the text that the driver prints when the board starts.
bool is_greeting(std::string_view line) {
  return line.find("TMF88") != std::string_view::npos &&
         line.find("Arduino") != std::string_view::npos;
}

/// Interprets the lines one by one.
class LogLines {
 public:
  LogLines(Tmf882xLayout layout, int i2c_address, bool has_results, bool stream, std::string path,
           const Report& report)
      : path_(std::move(path)),
        report_(report),
        assembler_(layout, has_results, stream, path_, report),
        filter_(i2c_address, report) {}

  /// Returns false if the text ends within this line; the line is then ignored.
  bool add(const TextLine& line) {
    std::string_view text = line.text;
    // A serial monitor may put text before its lines; such text never contains this sign.
    if (const std::size_t begins = text.find('#'); begins != std::string_view::npos) {
      text.remove_prefix(begins);
    }
    if (text.starts_with("#Raw")) return add_raw(line, text);
    if (text.starts_with("#Obj,")) {
      add_result(line, text);
    } else if (is_greeting(text)) {
      assembler_.restart(line.number);
    }
    return true;
  }

  Assembler& assembler() { return assembler_; }

 private:
  bool add_raw(const TextLine& line, std::string_view text) {
    const std::string where = line_place(path_, line.number);
    try {
      const RawLine raw = parse_raw_line(text, where);
      if (filter_.accepts(raw.address, where)) assembler_.add(raw, line.number);
    } catch (const Error& damage) {
      if (!line.ended) return false;
      report_(LineFault::damaged_line, std::string(damage.what()) + "; the line is left out");
    }
    return true;
  }

  void add_result(const TextLine& line, std::string_view text) {
    const std::vector<std::string_view> fields = fields_of(text, ',');
    const auto address = fields.size() > 1 ? whole_number_of(fields[1]) : std::nullopt;
    const auto number = fields.size() > 2 ? whole_number_of(fields[2]) : std::nullopt;
    if (address && number && *number >= 0 &&
        filter_.accepts(static_cast<int>(*address), line_place(path_, line.number))) {
      assembler_.add_result(static_cast<int>(*number % 4), line.number);
    }
  }

  std::string path_;
  Report report_;
  Assembler assembler_;
  AddressFilter filter_;
};

CaptureFile read(const ImportSource& source, const ImportOptions& options, ImportNotes& notes) {
  const std::string& path = source.path();
  const Tmf882xLayout layout = tmf882x_layout(options);
  const bool has_results = source.bytes().find("#Obj,") != std::string::npos;
  const std::size_t notes_before = notes.size();
  LogLines lines(layout, options.i2c_address, has_results, false, path,
                 [&](LineFault, const std::string& text) { notes.push_back(text); });
  bool cut_off = false;  // the text ends within its last line
  for (const TextLine& line : lines_of(source.bytes())) {
    cut_off = !lines.add(line);
    if (cut_off) break;
  }
  CaptureFile file;
  file.captures = lines.assembler().finish(cut_off || source.cut());
  file.sensor = "tmf8828";
  if (file.captures.empty()) {
    throw Error(path, "holds no complete capture of " + std::to_string(layout.side) + " x " +
                          std::to_string(layout.side) + " zones (30 #Raw lines each measurement, " +
                          std::to_string(layout.measurements) + " measurements each capture)" +
                          (notes.size() > notes_before ? "; first: " + notes[notes_before] : ""));
  }
  return file;
}

bool recognise_line(std::string_view line) {
  return line.find("#Raw,") != std::string_view::npos || is_greeting(line);
}

ImportOptions zones_of(int rows, int columns) {
  ImportOptions options;
  options.rows = rows;
  options.columns = columns;
  return options;
}

/// A stream of the same lines.
class LogStream : public LineReader {
 public:
  explicit LogStream(const LineOptions& options)
      : lines_(tmf882x_layout(zones_of(options.rows, options.columns)), options.i2c_address, false,
               true, options.path, [this](LineFault fault, const std::string& text) {
                 yield_->notes.push_back({fault, text});
               }) {}

  void add(const TextLine& line, LineYield& yield) override {
    yield_ = &yield;
    lines_.add(line);
    for (Capture& capture : lines_.assembler().take()) yield.captures.push_back(std::move(capture));
  }

  void interrupt(LineYield& yield) override {
    yield_ = &yield;
    lines_.assembler().interrupt();
  }

 private:
  LineYield* yield_ = nullptr;  ///< output for the line that is being read
  LogLines lines_;
};

std::string print(const Capture& capture, const std::string& where) {
  constexpr int kAddress = 65;  // the sensor's default address
  constexpr double kMostCounts = (1 << 24) - 1;
  const HistogramCube& counts = capture.counts;
  if (counts.bins != kBins) {
    throw Error(where, "found " + std::to_string(counts.bins) + " bins, accepted: 128");
  }
  const Tmf882xLayout layout = tmf882x_layout(zones_of(counts.rows, counts.columns));
  std::string log;
  for (int measurement = 0; measurement < layout.measurements; ++measurement) {
    for (int index = 0; index < kLines; ++index) {
      const int channel = index % kChannels;
      const bool used = channel >= 1 && channel <= layout.channels;
      log += "#Raw," + std::to_string(kAddress) + "," + std::to_string(index);
      for (int bin = 0; bin < kBins; ++bin) {
        const double count = used ? counts.zone(layout.zone(measurement, channel))[bin] : 0.0;
        if (!(count >= 0 && count <= kMostCounts && count == std::floor(count))) {
          throw Error(where, "found a count of " + std::to_string(count) +
                                 ", accepted: whole numbers from 0 to 16777215");
        }
        const auto byte = (static_cast<std::uint32_t>(count) >> (8 * (index / kChannels))) & 255U;
        log += "," + std::to_string(byte);
      }
      log += "\n";
    }
  }
  return log;
}

}  // namespace

CaptureReader tmf8828_log_reader() {
  return {.name = "tmf8828",
          .recognises = "serial log of the TMF8828 Arduino driver, lines #Raw,...",
          .assumes = "3 x 3 zones unless --rows and --columns say 4 or 8",
          .options = {"rows", "i2c_address"},
          .recognise = recognise,
          .read = read,
          .recognise_line = recognise_line,
          .lines = stream_of<LogStream>,
          .print = print};
}

int Tmf882xLayout::zone(int measurement, int channel) const {
  if (side < 8) return measurement * channels + channel - 1;
  const int row = 7 - 2 * ((channel - 1) / 2) - measurement / 4;
  const int column = 4 * ((channel - 1) % 2) + measurement % 4;
  return row * side + column;
}

Tmf882xLayout tmf882x_layout(const ImportOptions& options) {
  const int rows = options.rows == 0 ? 3 : options.rows;
  const int columns = options.columns == 0 ? 3 : options.columns;
  if (rows == 3 && columns == 3) return {3, 1, 9};
  if (rows == 4 && columns == 4) return {4, 2, 8};
  if (rows == 8 && columns == 8) return {8, 8, 8};
  throw Error("rows, columns", "found " + std::to_string(rows) + " x " + std::to_string(columns) +
                                   ", a TMF8828 log is 3 x 3, 4 x 4 or 8 x 8");
}

std::string tmf8828_log(const CaptureFile& file, const std::string& path) {
  std::string log;
  for (std::size_t i = 0; i < file.captures.size(); ++i) {
    log += print(file.captures[i], path + ": capture " + std::to_string(i));
  }
  return log;
}

}  // namespace blindcorner
