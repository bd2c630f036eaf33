// SPDX-License-Identifier: Apache-2.0
/// Captures from the lines of a sensor as they arrive. Readers of logs in lines offer this besides
/// reading a whole file, and use the same code for a line.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "blindcorner/forward/sensor/capture.h"
#include "io/readers/text_lines.h"

namespace blindcorner {

/// What may be wrong with lines.
enum class LineFault {
  damaged_line,        ///< cut or corrupt; left out
  repeated_line,       ///< the same line once more; left out
  incomplete_capture,  ///< lines are missing; the capture is left out
  restart,             ///< the board started again
  other_lines,         ///< of another sensor or of another kind; left out
  assumption           ///< nothing is wrong: how the lines were understood
};

/// One thing that was odd, with the line that it is about.
struct LineNote {
  LineFault fault = LineFault::damaged_line;
  std::string text;
};

/// What one line gave.
struct LineYield {
  std::vector<Capture> captures;
  std::vector<LineNote> notes;
};

/// What is known of the sensor before its first line.
struct LineOptions {
  int rows = 0, columns = 0, bins = 0;  ///< of the scene that the captures are for
  int i2c_address = 0;                  ///< as in ImportOptions
  std::string array;                    ///< as in ImportOptions
  std::string path = "input";           ///< names the stream in notes
};

/// Reads the lines of one stream. A capture comes out with the line that completes it.
class LineReader {
 public:
  virtual ~LineReader() = default;

  virtual void add(const TextLine& line, LineYield& yield) = 0;

  /// The stream was interrupted: what comes next does not follow what came before.
  virtual void interrupt(LineYield& yield) = 0;
};

/// A `CaptureReader::lines` that makes streams of one kind.
template <typename Stream>
std::unique_ptr<LineReader> stream_of(const LineOptions& options) {
  return std::make_unique<Stream>(options);
}

}  // namespace blindcorner
