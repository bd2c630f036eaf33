// SPDX-License-Identifier: Apache-2.0
/// TMF882x histograms as lines `#HLONG<channel>` and `#HSHORT<channel>` with one number per bin:
///
///   #HLONG01;128;167;...   the makers' EVM program, from the files that it writes ("sep=;") and
///                          from its TCP bridge: channels from 1 are the zones row by row, all
///                          measurements of a capture in one go; the reference is not among them.
///   #HLONG0123,119,...     SparkFun's TMF882X Arduino library (example 11), channel and first bin
///                          without a separator: channels 0 to 9 of one measurement, 0 the
///                          reference. `Histogram Number: 3` counts measurements from the start.
///   #HLONG-3:128,167,...   with a dash and a colon, as sketches print it.
///   #HLONG0,<256 bins>     a line for each of five converters: two channels, one in each half.
///
/// The number of fields tells the first two formats apart, because the number of bins is a power of
/// two.
#include <algorithm>
#include <bit>
#include <map>
#include <memory>
#include <set>
#include <tuple>

#include "blindcorner/forward/error.h"
#include "io/readers/arrays.h"
#include "io/readers/capture_reader.h"
#include "io/readers/text_lines.h"
#include "io/readers/tmf8828_log.h"

namespace blindcorner {
namespace {

constexpr std::string_view kCounter = "Histogram Number:";
constexpr int kConverterBins = 256;  ///< of the two channels of a time-to-digital converter

/// One line, whose fields are not yet read as numbers.
struct HistogramLine {
  int number = 0;
  std::string_view kind;  ///< "HLONG" or "HSHORT"
  std::vector<std::string_view> fields;
  int counter = 0;  ///< of measurements, from 1; 0: no counter stands before the line
};

/// A histogram with its place in the log.
struct Histogram {
  int line = 0;
  int channel = 0;
  int counter = 0;
  std::vector<double> bins;
};

/// One measurement: channels that came one after the other.
struct Measurement {
  int first_line = 0;
  int counter = 0;
  std::map<int, std::vector<double>> channels;
};

std::string_view kind_of(std::string_view text) {
  for (const std::string_view kind : {"HLONG", "HSHORT"}) {
    if (text.starts_with("#") && text.substr(1).starts_with(kind)) return kind;
  }
  return {};
}

/// The histogram of a line; nothing for other lines. A line that counts measurements sets
/// `counter`.
std::optional<HistogramLine> histogram_line(const TextLine& line, int& counter) {
  std::string_view rest = line.text;
  if (const std::size_t at = rest.find(kCounter); at != std::string_view::npos) {
    std::string_view digits = rest.substr(at + kCounter.size());
    digits.remove_prefix(std::min(digits.find_first_not_of(' '), digits.size()));
    counter = static_cast<int>(whole_number_of(digits).value_or(0));
  }
  // A serial monitor may put text before its lines; such text never contains this sign.
  rest.remove_prefix(std::min(rest.find('#'), rest.size()));
  const std::string_view kind = kind_of(rest);
  if (kind.empty()) return std::nullopt;
  rest.remove_prefix(1 + kind.size());
  if (rest.starts_with('-')) rest.remove_prefix(1);
  HistogramLine found{line.number, kind, {}, counter};
  if (const std::size_t colon = rest.find(':'); colon != std::string_view::npos) {
    found.fields.push_back(rest.substr(0, colon));
    rest.remove_prefix(colon + 1);
  }
  for (const std::string_view field : fields_of(rest, separator_of(rest))) {
    found.fields.push_back(field);
  }
  if (found.fields.size() > 1 && found.fields[1].starts_with("Bin"))
    return std::nullopt;  // heading
  if (found.fields.empty()) found.fields.emplace_back();
  return found;
}

std::vector<HistogramLine> histogram_lines(const std::string& text) {
  std::vector<HistogramLine> lines;
  int counter = 0;
  for (const TextLine& line : lines_of(text)) {
    if (auto found = histogram_line(line, counter)) lines.push_back(std::move(*found));
  }
  return lines;
}

/// How many fields most lines have.
std::size_t usual_fields(const std::vector<HistogramLine>& lines) {
  std::map<std::size_t, int> counts;
  for (const HistogramLine& line : lines) ++counts[line.fields.size()];
  return std::ranges::max_element(counts, {}, [](const auto& c) { return c.second; })->first;
}

/// The histogram of a line of `fields` fields. Throws Error naming `where` for a damaged one.
Histogram parse(const HistogramLine& line, std::size_t fields, const std::string& where) {
  if (line.fields.size() != fields) {
    throw Error(where, "has " + std::to_string(line.fields.size()) + " fields, most lines have " +
                           std::to_string(fields));
  }
  Histogram histogram{line.number, 0, line.counter, {}};
  std::string_view head = line.fields.front();
  if (std::has_single_bit(fields)) {  // the channel's one digit and the first bin are one field
    histogram.bins.push_back(
        number_of(head.substr(std::min<std::size_t>(1, head.size()))).value_or(-1));
    head = head.substr(0, 1);
  }
  const std::optional<long> channel = whole_number_of(head);
  if (!channel || *channel < 0 || *channel > 64) {
    throw Error(where, "its channel is '" + std::string(head) + "', accepted 0 to 64");
  }
  histogram.channel = static_cast<int>(*channel);
  for (std::size_t i = 1; i < fields; ++i) {
    histogram.bins.push_back(number_of(line.fields[i]).value_or(-1));
  }
  const auto bad = std::ranges::find_if(histogram.bins, [](double count) { return count < 0; });
  if (bad != histogram.bins.end()) {
    throw Error(where, "bin " + std::to_string(bad - histogram.bins.begin()) +
                           " is damaged, accepted a number >= 0");
  }
  return histogram;
}

void add_channel(Measurement& measurement, Histogram histogram) {
  if (std::ssize(histogram.bins) != kConverterBins) {
    measurement.channels[histogram.channel] = std::move(histogram.bins);
    return;
  }
  const auto half = histogram.bins.begin() + kConverterBins / 2;
  measurement.channels[2 * histogram.channel].assign(histogram.bins.begin(), half);
  measurement.channels[2 * histogram.channel + 1].assign(half, histogram.bins.end());
}

/// Measurements in the order of the log. A channel that is not above the one before it begins
/// another.
std::vector<Measurement> measurements_of(const std::vector<HistogramLine>& lines,
                                         const std::string& path, ImportNotes& notes) {
  const std::size_t fields = usual_fields(lines);
  if (!std::has_single_bit(fields) && !std::has_single_bit(fields - 1)) {
    throw Error(line_place(path, lines.front().number),
                "most histograms have " + std::to_string(fields) +
                    " fields, accepted: the channel and 128 or 256 bins");
  }
  std::vector<Measurement> measurements;
  int last = 0;
  for (const HistogramLine& line : lines) {
    try {
      Histogram histogram = parse(line, fields, line_place(path, line.number));
      if (measurements.empty() || histogram.channel <= last) {
        measurements.push_back({line.number, line.counter, {}});
      }
      last = histogram.channel;
      add_channel(measurements.back(), std::move(histogram));
    } catch (const Error& damage) {
      notes.push_back(std::string(damage.what()) + "; the line is left out");
    }
  }
  return measurements;
}

std::set<int> channels_of(const Measurement& measurement) {
  std::set<int> channels;
  for (const auto& [channel, bins] : measurement.channels) channels.insert(channel);
  return channels;
}

std::string list(const std::set<int>& channels) {
  std::string text;
  for (const int channel : channels) text += (text.empty() ? "" : ", ") + std::to_string(channel);
  return text;
}

/// Leaves out measurements that lack channels which most have.
std::vector<Measurement> whole_ones(std::vector<Measurement> measurements, const std::string& path,
                                    ImportNotes& notes) {
  std::map<std::set<int>, int> sets;
  for (const Measurement& measurement : measurements) ++sets[channels_of(measurement)];
  const auto usual = std::ranges::max_element(sets, [](const auto& a, const auto& b) {
    return std::pair(a.second, a.first.size()) < std::pair(b.second, b.first.size());
  });
  std::erase_if(measurements, [&](const Measurement& measurement) {
    const std::set<int> found = channels_of(measurement);
    if (found == usual->first) return false;
    notes.push_back(line_place(path, measurement.first_line) +
                    ": the measurement that begins here has channels " + list(found) +
                    ", most have " + list(usual->first) + "; left out");
    return true;
  });
  return measurements;
}

/// Which channel of which measurement is which zone. Zones are the channels from 1, or channel 0 if
/// it is the only one. If more zones are stated than there are channels, several measurements make
/// a capture.
class Arrangement {
 public:
  Arrangement(const Measurement& usual, const ImportOptions& options, const std::string& path,
              ImportNotes& notes) {
    std::set<int> channels = channels_of(usual);
    reference_ = channels.size() > 1 && *channels.begin() == 0;
    if (reference_) channels.erase(0);
    if (options.rows * options.columns > static_cast<int>(channels.size())) {
      const Tmf882xLayout layout = tmf882x_layout(options);
      measurements_ = layout.measurements;
      rows_ = columns_ = layout.side;
      for (int m = 0; m < measurements_; ++m) {
        for (int channel = 1; channel <= layout.channels; ++channel) {
          if (channels.contains(channel)) zones_[{m, channel}] = layout.zone(m, channel);
        }
      }
    } else {
      ImportNotes square_is_the_rule;
      std::tie(rows_, columns_) = zone_layout(channels.size(), options, path, square_is_the_rule);
      int zone = 0;
      for (const int channel : channels) zones_[{0, channel}] = zone++;
    }
    notes.push_back(
        path + ": took " +
        (reference_ ? std::string("channel 0 as the reference, left out, and ") : "") +
        "channels " + list(channels) + " as zones row by row, " + std::to_string(rows_) + " x " +
        std::to_string(columns_) +
        (measurements_ > 1 ? " from " + std::to_string(measurements_) + " measurements each" : ""));
  }

  int measurements() const { return measurements_; }

  Capture capture(const Measurement* first) const {
    Capture capture;
    const auto bins = static_cast<int>(first->channels.begin()->second.size());
    capture.counts = HistogramCube(rows_, columns_, bins);
    for (const auto& [place, zone] : zones_) {
      std::ranges::copy(first[place.first].channels.at(place.second), capture.counts.zone(zone));
    }
    return capture;
  }

 private:
  bool reference_ = false;
  int measurements_ = 1;
  int rows_ = 0, columns_ = 0;
  std::map<std::pair<int, int>, int> zones_;  ///< (measurement, channel) -> zone
};

bool recognise(const ImportSource& source) {
  return source.beginning().find("#HLONG") != std::string::npos ||
         source.beginning().find("#HSHORT") != std::string::npos;
}

/// The lines of the chosen kind, or of the one that the log begins with.
std::vector<HistogramLine> chosen_lines(const ImportSource& source, const ImportOptions& options,
                                        ImportNotes& notes) {
  std::vector<HistogramLine> lines = histogram_lines(source.bytes());
  if (lines.empty()) throw Error(source.path(), "holds no lines #HLONG or #HSHORT with bins");
  const std::string kind(options.array.empty() ? lines.front().kind : options.array);
  const std::size_t others =
      std::erase_if(lines, [&](const HistogramLine& line) { return line.kind != kind; });
  if (lines.empty()) {
    throw Error("array", "found '" + kind + "', accepted HLONG and HSHORT, as the log has them");
  }
  if (others > 0) {
    notes.push_back(source.path() + ": " + std::to_string(others) +
                    " histograms of another kind are left out, those of #" + kind +
                    " are kept; --array chooses");
  }
  return lines;
}

CaptureFile read(const ImportSource& source, const ImportOptions& options, ImportNotes& notes) {
  const std::string& path = source.path();
  const std::vector<HistogramLine> lines = chosen_lines(source, options, notes);
  const std::vector<Measurement> measurements =
      whole_ones(measurements_of(lines, path, notes), path, notes);
  if (measurements.empty()) throw Error(path, "holds no whole measurement");
  const Arrangement arrangement(measurements.front(), options, path, notes);
  CaptureFile file;
  file.sensor = "tmf882x";
  const auto count = static_cast<std::size_t>(arrangement.measurements());
  for (std::size_t i = 0; i < measurements.size();) {
    const bool starts = measurements[i].counter == 0 ||
                        (measurements[i].counter - 1) % static_cast<int>(count) == 0;
    bool whole = starts && i + count <= measurements.size();
    for (std::size_t k = 1; whole && k < count; ++k) {
      whole = measurements[i + k].counter ==
              (measurements[i].counter == 0 ? 0 : measurements[i].counter + static_cast<int>(k));
    }
    if (!whole) {
      notes.push_back(line_place(path, measurements[i].first_line) +
                      ": the measurement that begins here has no others to make a capture; left "
                      "out");
      ++i;
      continue;
    }
    file.captures.push_back(arrangement.capture(&measurements[i]));
    i += count;
  }
  if (file.captures.empty()) throw Error(path, "holds no whole capture");
  return file;
}

}  // namespace

namespace {

bool recognise_line(std::string_view line) {
  return line.find("#HLONG") != std::string_view::npos ||
         line.find("#HSHORT") != std::string_view::npos;
}

/// A stream of the same lines. The first two measurements that are alike show which channels a
/// measurement has. After that, a measurement is complete with its last channel.
class LineStream : public LineReader {
 public:
  explicit LineStream(LineOptions options) : options_(std::move(options)) {
    zones_.rows = options_.rows;
    zones_.columns = options_.columns;
  }

  void add(const TextLine& line, LineYield& yield) override {
    const std::optional<HistogramLine> found = histogram_line(line, counter_);
    if (!found) return;
    if (kind_.empty()) kind_ = options_.array.empty() ? found->kind : options_.array;
    if (found->kind != kind_) return tell_other_kind(line, yield);
    if (line.text == last_) {
      return note(line, LineFault::repeated_line, "comes twice; the second is left out", yield);
    }
    last_ = line.text;
    try {
      const std::size_t fields = found->fields.size();
      if (!has_bins(fields)) {
        throw Error(line_place(options_.path, line.number),
                    "has " + std::to_string(fields) + " fields, accepted: the channel and " +
                        std::to_string(options_.bins) + " bins");
      }
      add(parse(*found, fields, line_place(options_.path, line.number)), yield);
    } catch (const Error& damage) {
      yield.notes.push_back(
          {LineFault::damaged_line, std::string(damage.what()) + "; the line is left out"});
    }
  }

  void interrupt(LineYield& yield) override {
    if (!pending_.empty() || (arrangement_ && !current_.channels.empty())) leave_out(yield);
    pending_.clear();
    current_ = {};
    last_.clear();
  }

 private:
  /// Whether a line has the bins of one channel, or of two in the halves of a converter's line.
  /// Channel and first bin may share a field.
  bool has_bins(std::size_t fields) const {
    const auto bins = static_cast<std::size_t>(options_.bins);
    return fields == bins || fields == bins + 1 ||
           (2 * bins == kConverterBins && (fields == 2 * bins || fields == 2 * bins + 1));
  }

  void note(const TextLine& line, LineFault fault, const std::string& text, LineYield& yield) {
    yield.notes.push_back({fault, line_place(options_.path, line.number) + ": " + text});
  }
  void tell_other_kind(const TextLine& line, LineYield& yield) {
    if (std::exchange(other_kind_told_, true)) return;
    note(line, LineFault::other_lines,
         "histograms of another kind are left out, those of #" + kind_ + " are kept", yield);
  }

  void add(Histogram histogram, LineYield& yield) {
    const int channel = histogram.channel;
    if (!current_.channels.empty() && channel <= current_.channels.rbegin()->first) close(yield);
    if (current_.channels.empty()) {
      current_.first_line = histogram.line;
      current_.counter = histogram.counter;
    }
    add_channel(current_, std::move(histogram));
    if (arrangement_ && channels_of(current_) == usual_) close(yield);
  }

  /// Ends the current measurement.
  void close(LineYield& yield) {
    Measurement measurement = std::exchange(current_, {});
    const std::set<int> found = channels_of(measurement);
    if (!arrangement_) {
      if (found != usual_) {
        usual_ = found;
        return;
      }
      ImportNotes said;
      arrangement_.emplace(measurement, zones_, options_.path, said);
      for (const std::string& text : said) yield.notes.push_back({LineFault::assumption, text});
    }
    const int count = arrangement_->measurements();
    const bool first = measurement.counter == 0 || (measurement.counter - 1) % count == 0;
    if (measurement.counter != 0 && first && !pending_.empty()) {
      leave_out(yield);
      pending_.clear();
    }
    if (measurement.counter != 0 && !first && pending_.empty()) return;
    if (found != usual_) whole_ = false;
    if (pending_.empty()) whole_ = found == usual_;
    pending_.push_back(std::move(measurement));
    if (std::ssize(pending_) < count) return;
    if (whole_) {
      yield.captures.push_back(arrangement_->capture(pending_.data()));
    } else {
      leave_out(yield);
    }
    pending_.clear();
  }

  void leave_out(LineYield& yield) {
    const int line = pending_.empty() ? current_.first_line : pending_.front().first_line;
    yield.notes.push_back({LineFault::incomplete_capture,
                           line_place(options_.path, line) +
                               ": the capture that begins here lacks channels; left out"});
  }

  LineOptions options_;
  ImportOptions zones_;
  std::string kind_, last_;
  bool other_kind_told_ = false;
  int counter_ = 0;
  std::set<int> usual_;
  std::optional<Arrangement> arrangement_;
  Measurement current_;
  std::vector<Measurement> pending_;  ///< measurements of the current capture
  bool whole_ = true;                 ///< these measurements have all their channels
};

}  // namespace

CaptureReader tmf882x_lines_reader() {
  return {.name = "tmf882x",
          .recognises = "TMF882x lines #HLONG<channel> or #HSHORT<channel> with a number a bin",
          .assumes = "channel 0 is the reference, the others are zones row by row",
          .options = {"rows", "array"},
          .recognise = recognise,
          .read = read,
          .recognise_line = recognise_line,
          .lines = stream_of<LineStream>};
}

}  // namespace blindcorner
