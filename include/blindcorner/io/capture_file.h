// SPDX-License-Identifier: Apache-2.0
/// Native capture file: OpenEXR with channel Y, one row per histogram, and JSON metadata in the
/// string attribute `blindcorner`.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

/// Captures that share zones and bins.
struct CaptureFile {
  std::vector<Capture> captures;
  double bin_width = 0.0;   ///< s; 0 when unknown
  std::string sensor;       ///< name of the sensor, may be empty
  std::string description;  ///< free text
};

/// Reads a capture file. Throws Error (one line: file, what is wrong, what is accepted) for a file
/// that is missing, truncated or not EXR, has another pixel type, has no metadata, or has metadata
/// that does not fit the pixels. The values are not checked here: the fit refuses NaN.
CaptureFile read_captures(const std::string& path);

/// Writes atomically (a temporary file beside `path`, then a rename). All captures must have equal
/// rows, columns and bins. Throws Error.
void write_captures(const std::string& path, const CaptureFile& file);

}  // namespace blindcorner
