// SPDX-License-Identifier: Apache-2.0
/// The JSON text that accompanies the counts of a capture file, whether in EXR or .npz
/// (docs/capture.md), for programs that keep the counts elsewhere.
#pragma once

#include <string>

#include "blindcorner/io/capture_file.h"

namespace blindcorner {

/// Throws Error naming `path` unless there is at least one capture, all have the same rows, columns
/// and bins, and everything that is stored beside the counts is in range.
void check_captures(const CaptureFile& file, const std::string& path);

/// Metadata of format "blindcorner.capture/1"; `file` has passed `check_captures`.
std::string metadata_text(const CaptureFile& file);

/// The inverse: captures with rows, columns and bins, but no counts yet (the caller allocates them
/// once it has seen that the file is large enough to hold them), nor source and index. `where`
/// (file and field) begins the messages of the Error that wrong metadata throws.
CaptureFile parse_metadata(const std::string& text, const std::string& where);

}  // namespace blindcorner
