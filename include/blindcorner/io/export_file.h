// SPDX-License-Identifier: Apache-2.0
/// Captures for other programs: NumPy archives and tables of numbers.
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

/// One of the two, chosen by the ending of `path`. Throws Error for other endings.
void export_captures(const std::string& path, const CaptureFile& file);

}  // namespace blindcorner
