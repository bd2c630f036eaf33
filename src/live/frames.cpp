// SPDX-License-Identifier: Apache-2.0
#include "live/frames.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "blindcorner/forward/error.h"

namespace blindcorner::live {
namespace {

/// Bytes of the longest line that any sensor sends: 64 x 64 zones of 256 bins with eight characters
/// each.
constexpr std::size_t kLongestLine = 8UL << 20;
/// After this many lines of no known format the user is told. A board's greeting has fewer lines.
constexpr long kManyUnknown = 100;

Count kind_of(LineFault fault) {
  switch (fault) {
    case LineFault::damaged_line:
      return Count::damaged_lines;
    case LineFault::repeated_line:
      return Count::repeated_lines;
    case LineFault::incomplete_capture:
      return Count::incomplete_captures;
    case LineFault::restart:
      return Count::restarts;
    default:
      return Count::other_lines;
  }
}

std::string extent(int rows, int columns, int bins) {
  return std::to_string(rows) + " x " + std::to_string(columns) + " zones of " +
         std::to_string(bins) + " bins";
}

}  // namespace

std::vector<std::string> stream_formats() {
  std::vector<std::string> names;
  for (const CaptureReader& reader : capture_readers()) {
    if (reader.lines != nullptr) names.emplace_back(reader.name);
  }
  return names;
}

const CaptureReader& stream_reader(const std::string& name) {
  std::string names = "auto";
  for (const CaptureReader& reader : capture_readers()) {
    if (reader.lines == nullptr) continue;
    if (reader.name == name) return reader;
    names += ", " + std::string(reader.name);
  }
  throw Error("format", "found '" + name + "', accepted: " + names);
}

const CaptureReader* recognise_stream(std::string_view line) {
  for (const CaptureReader& reader : capture_readers()) {
    if (reader.recognise_line != nullptr && reader.recognise_line(line)) return &reader;
  }
  return nullptr;
}

long LineSplitter::add(std::string_view bytes, const std::function<void(const TextLine&)>& use) {
  long too_long = 0;
  while (!bytes.empty()) {
    const std::size_t end = bytes.find('\n');
    const std::string_view part = bytes.substr(0, end);
    if (!too_long_) begun_ += part;
    if (begun_.size() > longest_) {
      begun_.clear();
      begun_.shrink_to_fit();
      too_long_ = true;
      ++too_long;
    }
    if (end == std::string_view::npos) break;
    bytes.remove_prefix(end + 1);
    if (number_ < std::numeric_limits<int>::max()) ++number_;
    if (!std::exchange(too_long_, false)) {
      std::string_view text = begun_;
      text.remove_suffix(text.size() - (text.find_last_not_of(" \r") + 1));
      use({number_, text, true});
    }
    begun_.clear();
  }
  return too_long;
}

void LineSplitter::interrupt() {
  begun_.clear();
  too_long_ = false;
}

FrameAssembler::FrameAssembler(const Sensor& sensor, const std::string& format, LineOptions options,
                               Tally& tally)
    : rows_(sensor.rows),
      columns_(sensor.columns),
      bins_(sensor.bins),
      options_(std::move(options)),
      tally_(tally),
      splitter_(kLongestLine) {
  options_.rows = rows_;
  options_.columns = columns_;
  options_.bins = bins_;
  if (format != "auto") reader_ = stream_reader(format).lines(options_);
}

void FrameAssembler::add(std::string_view bytes, Clock::time_point now,
                         const std::function<void(Frame)>& use) {
  const long too_long =
      splitter_.add(bytes, [&](const TextLine& line) { add_line(line, now, use); });
  if (too_long > 0) {
    tally_.note(Count::long_lines, options_.path + ": a line is longer than 8 MiB; left out",
                too_long);
  }
}

void FrameAssembler::interrupt() {
  splitter_.interrupt();
  if (!reader_) return;
  LineYield yield;
  reader_->interrupt(yield);
  tell(yield);
}

void FrameAssembler::add_line(const TextLine& line, Clock::time_point now,
                              const std::function<void(Frame)>& use) {
  tally_.add(Count::lines);
  if (!reader_) {
    const CaptureReader* const found = recognise_stream(line.text);
    if (found == nullptr) {
      if (++unknown_ == kManyUnknown) {
        tally_.say(options_.path + ": no format is recognised yet after " +
                   std::to_string(kManyUnknown) + " lines; --format names one");
      }
      return;
    }
    reader_ = found->lines(options_);
  }
  LineYield yield;
  reader_->add(line, yield);
  tell(yield);
  for (Capture& capture : yield.captures) {
    if (const std::string found = misfit(capture.counts); !found.empty()) {
      tally_.note(Count::unsuitable_frames, line_place(options_.path, line.number) + ": found " +
                                                found + ", accepted: the scene's " +
                                                extent(rows_, columns_, bins_));
      continue;
    }
    tally_.add(Count::frames);
    capture.source = options_.path;
    capture.index = static_cast<int>(std::min<long>(next_, std::numeric_limits<int>::max()));
    use({std::move(capture), next_++, now});
  }
}

void FrameAssembler::tell(const LineYield& yield) {
  for (const LineNote& note : yield.notes) {
    if (note.fault == LineFault::assumption) {
      tally_.say(note.text);
    } else {
      tally_.note(kind_of(note.fault), note.text);
    }
  }
}

std::string FrameAssembler::misfit(const HistogramCube& counts) const {
  if (counts.rows == rows_ && counts.columns == columns_ && counts.bins == bins_) return {};
  return extent(counts.rows, counts.columns, counts.bins);
}

}  // namespace blindcorner::live
