// SPDX-License-Identifier: Apache-2.0
/// Turns the bytes of a stream into lines, and the lines into frames.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/forward/sensor/sensor.h"
#include "io/readers/capture_reader.h"
#include "live/tally.h"

namespace blindcorner::live {

using Clock = std::chrono::steady_clock;

/// One frame of the stream.
struct Frame {
  Capture capture;
  long number = 0;            ///< counted from 0 over all whole frames that suit the scene
  Clock::time_point arrived;  ///< when the frame's last byte arrived
};

/// Cuts bytes into lines. A line of more than `longest` bytes is left out: no sensor sends one.
class LineSplitter {
 public:
  explicit LineSplitter(std::size_t longest) : longest_(longest) {}

  /// Calls `use` with each line that these bytes complete. Returns how many lines were too long.
  long add(std::string_view bytes, const std::function<void(const TextLine&)>& use);
  /// Forgets a line that was begun.
  void interrupt();

 private:
  const std::size_t longest_;
  std::string begun_;
  bool too_long_ = false;
  int number_ = 0;
};

/// Assembles the frames of one stream. The format is the one named, or the one that the first lines
/// show.
class FrameAssembler {
 public:
  /// `format` is the name of a reader, or "auto". Throws Error for a reader that reads no streams.
  FrameAssembler(const Sensor& sensor, const std::string& format, LineOptions options,
                 Tally& tally);

  /// Takes bytes that came at `now`, and calls `use` with each frame that they complete.
  void add(std::string_view bytes, Clock::time_point now, const std::function<void(Frame)>& use);
  /// To be called when the stream was interrupted.
  void interrupt();

 private:
  void add_line(const TextLine& line, Clock::time_point now, const std::function<void(Frame)>& use);
  void tell(const LineYield& yield);
  std::string misfit(const HistogramCube& counts) const;

  int rows_, columns_, bins_;
  LineOptions options_;
  Tally& tally_;
  LineSplitter splitter_;
  std::unique_ptr<LineReader> reader_;
  long next_ = 0;
  long unknown_ = 0;  ///< lines that no format has recognised
};

/// Names of the formats that come as streams.
std::vector<std::string> stream_formats();
/// The stream reader of that name. Throws Error that lists the accepted names.
const CaptureReader& stream_reader(const std::string& name);
/// The reader that recognises a line; null: none does.
const CaptureReader* recognise_stream(std::string_view line);

}  // namespace blindcorner::live
