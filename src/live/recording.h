// SPDX-License-Identifier: Apache-2.0
/// Recordings as the sensor sent them: text, frame by frame.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "blindcorner/io/import_file.h"

namespace blindcorner::live {

/// The frames of a capture file or log in their order. The text of a frame ends with the line that
/// completes the frame. Lines after the last frame belong to no frame and are left out.
class Recording {
 public:
  virtual ~Recording() = default;
  virtual std::size_t frames() const = 0;
  /// What the sensor sends for frame `i`, including the lines after the frame before. Throws Error
  /// for a capture that no sensor of the format makes.
  virtual std::string text(std::size_t i) const = 0;
};

/// Reads a capture file (.exr) or a log. `format` is the name of a format, or "auto": then the
/// sensor's name in the capture file, or the log's lines, decide. `options` say what a log does
/// not. Throws Error.
std::unique_ptr<Recording> open_recording(const std::string& path, const std::string& format,
                                          const ImportOptions& options);

}  // namespace blindcorner::live
