// SPDX-License-Identifier: Apache-2.0
/// The JSON text that accompanies the counts of a capture file in EXR or .npz (docs/capture.md),
/// for programs that keep the counts elsewhere.
#pragma once

#include <string>

#include "blindcorner/io/capture_file.h"

namespace blindcorner {

/// Throws Error naming `path` unless there is at least one capture, all captures have the same
/// rows, columns and bins, and all values stored beside the counts are in range.
void check_captures(const CaptureFile& file, const std::string& path);

/// Metadata of format "blindcorner.capture/1"; `file` must have passed `check_captures`.
std::string metadata_text(const CaptureFile& file);

/// The inverse: captures with rows, columns and bins, but without source, index and counts (the
/// caller allocates the counts after checking that the file is large enough to hold them). Throws
/// Error for wrong metadata; its message begins with `where` (file and field).
CaptureFile parse_metadata(const std::string& text, const std::string& where);

}  // namespace blindcorner
