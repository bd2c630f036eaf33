// SPDX-License-Identifier: Apache-2.0
/// Recordings as the sensor sent them: text, frame by frame.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "blindcorner/io/import_file.h"

namespace blindcorner::live {

/// Frames of capture files or logs in their order. A piece ends with the line that completes its
/// frame; lines after the last one are no frame's and left out.
class Recording {
 public:
  virtual ~Recording() = default;
  virtual std::size_t frames() const = 0;
  /// What the sensor sends for frame `i`, with what stands before it. Throws Error for a capture
  /// that no sensor of the format makes.
  virtual std::string text(std::size_t i) const = 0;
};

/// Reads a capture file (.exr) or a log. `format` is the name of a format, or "auto": as the
/// capture file's sensor is called, or as the log is. `options` say what a log does not. Throws
/// Error.
std::unique_ptr<Recording> open_recording(const std::string& path, const std::string& format,
                                          const ImportOptions& options);

}  // namespace blindcorner::live
