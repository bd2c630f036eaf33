// SPDX-License-Identifier: Apache-2.0
/// Captures for other programs: NumPy archives, tables of numbers, and logs as a sensor writes
/// them.
#pragma once

#include <string>

#include "blindcorner/io/capture_file.h"

namespace blindcorner {

/// `.npz` with `counts`, float64 [captures, zones, bins], and `metadata_json`, everything else as
/// the JSON text that the native file holds (`json.loads(archive["metadata_json"].item())`).
/// `import_captures` reads it back. Atomic. Throws Error.
void export_npz(const std::string& path, const CaptureFile& file);

/// `.csv` with the header `capture,zone,row,column,bin,count`, one line per count, all indices from
/// 0, counts with as many digits as they need to be read back exactly. Atomic. Throws Error.
void export_csv(const std::string& path, const CaptureFile& file);

/// `.log` as a TMF8828's driver prints its histograms (`import` reads it back): for trying out what
/// comes after a recording. Whole counts of 3 x 3, 4 x 4 or 8 x 8 zones of 128 bins. Atomic. Throws
/// Error.
void export_log(const std::string& path, const CaptureFile& file);

/// One of the three, chosen by the ending of `path`. Throws Error for other endings.
void export_captures(const std::string& path, const CaptureFile& file);

}  // namespace blindcorner
