// SPDX-License-Identifier: Apache-2.0
/// Captures for other programs: NumPy archives, tables of numbers, and logs in a sensor's own
/// format.
#pragma once

#include <string>

#include "blindcorner/io/capture_file.h"

namespace blindcorner {

/// Writes `.npz` with `counts`, float64 [captures, zones, bins], and `metadata_json`: everything
/// else, as the JSON text that the native file holds
/// (`json.loads(archive["metadata_json"].item())`). `import_captures` reads it back. Atomic. Throws
/// Error.
void export_npz(const std::string& path, const CaptureFile& file);

/// Writes `.csv` with the header `capture,zone,row,column,bin,count` and one line per count.
/// Indices start at 0. Each count has as many digits as it needs to be read back exactly. Atomic.
/// Throws Error.
void export_csv(const std::string& path, const CaptureFile& file);

/// Writes `.log` as the driver of a TMF8828 prints its histograms (`import` reads it back), to try
/// out the steps after a recording. Accepts whole counts of 3 x 3, 4 x 4 or 8 x 8 zones of 128
/// bins. Atomic. Throws Error.
void export_log(const std::string& path, const CaptureFile& file);

/// What a tal file needs in addition to the captures.
struct ExportOptions {
  int capture = -1;        ///< index in the file; -1: the only capture
  bool confocal = false;   ///< the laser lights the point that each zone looks at
  double time_zero = 0.0;  ///< s, arrival time of light with zero path length

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Writes `.hdf5` or `.h5` in the format in which tal (y-tal) keeps captures; `import` reads it
/// back. Single precision; the relay wall is turned into tal's frame. Data that captures do not
/// hold stay empty. Atomic. Throws Error.
void export_tal(const std::string& path, const CaptureFile& file,
                const ExportOptions& options = {});

/// Writes one of these formats, chosen by the ending of `path`. Throws Error for other endings and
/// for options that the format does not use.
void export_captures(const std::string& path, const CaptureFile& file,
                     const ExportOptions& options = {});

}  // namespace blindcorner
