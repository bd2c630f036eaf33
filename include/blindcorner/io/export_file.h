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

/// What a tal file needs beside the captures.
struct ExportOptions {
  int capture = -1;        ///< which one of the file; -1: the only one
  bool confocal = false;   ///< the laser lights the point that each zone looks at
  double time_zero = 0.0;  ///< s, when light of zero path length arrives

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// `.hdf5` or `.h5` as tal (y-tal) keeps captures, which `import` reads back: single precision, the
/// relay wall turned into its frame; what captures do not hold is empty. Atomic. Throws Error.
void export_tal(const std::string& path, const CaptureFile& file,
                const ExportOptions& options = {});

/// One of these, chosen by the ending of `path`. Throws Error for other endings, and for options
/// that an ending has no use for.
void export_captures(const std::string& path, const CaptureFile& file,
                     const ExportOptions& options = {});

}  // namespace blindcorner
