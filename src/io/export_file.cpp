// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/export_file.h"

#include <charconv>
#include <cmath>
#include <filesystem>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/atomic_file.h"
#include "io/capture_metadata.h"
#include "io/npy.h"
#include "io/npz.h"
#include "io/readers/tal.h"
#include "io/readers/tmf8828_log.h"

namespace blindcorner {
namespace {

/// Appends the shortest text that reads back as the same number.
template <typename Number>
void append_number(std::string& text, Number value) {
  char digits[32];
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  text.append(digits, end);
}

}  // namespace

void export_npz(const std::string& path, const CaptureFile& file) {
  check_captures(file, path);
  const HistogramCube& cube = file.captures.front().counts;
  std::vector<double> counts;
  for (const Capture& capture : file.captures) {
    counts.insert(counts.end(), capture.counts.values.begin(), capture.counts.values.end());
  }
  const std::vector<std::size_t> shape{file.captures.size(), static_cast<std::size_t>(cube.zones()),
                                       static_cast<std::size_t>(cube.bins)};
  write_atomically(path, npz_of({{"counts", npy_of(shape, counts)},
                                 {"metadata_json", npy_of(metadata_text(file))}}));
}

void export_csv(const std::string& path, const CaptureFile& file) {
  check_captures(file, path);
  std::string text = "capture,zone,row,column,bin,count\n";
  for (std::size_t i = 0; i < file.captures.size(); ++i) {
    const HistogramCube& cube = file.captures[i].counts;
    for (int zone = 0; zone < cube.zones(); ++zone) {
      for (int bin = 0; bin < cube.bins; ++bin) {
        append_number(text, i);
        for (const int index : {zone, zone / cube.columns, zone % cube.columns, bin}) {
          text += ',';
          append_number(text, index);
        }
        text += ',';
        append_number(text, cube.zone(zone)[bin]);
        text += '\n';
      }
    }
  }
  write_atomically(path, text);
}

void export_log(const std::string& path, const CaptureFile& file) {
  check_captures(file, path);
  write_atomically(path, tmf8828_log(file, path));
}

void ExportOptions::validate() const {
  if (capture < -1) {
    throw Error("capture", "found " + std::to_string(capture) + ", accepted 0 or more");
  }
  if (!std::isfinite(time_zero)) throw Error("time_zero", "accepted a finite number of seconds");
}

void export_tal(const std::string& path, const CaptureFile& file, const ExportOptions& options) {
  check_captures(file, path);
  options.validate();
  write_atomically(path, tal_file(file, options, path));
}

void export_captures(const std::string& path, const CaptureFile& file,
                     const ExportOptions& options) {
  const std::string ending = std::filesystem::path(path).extension().string();
  if (ending == ".hdf5" || ending == ".h5") return export_tal(path, file, options);
  if (options.capture >= 0 || options.confocal || options.time_zero != 0.0) {
    throw Error(path, "capture, confocal and time_zero are for .hdf5 (tal) only");
  }
  if (ending == ".npz") return export_npz(path, file);
  if (ending == ".csv") return export_csv(path, file);
  if (ending == ".log") return export_log(path, file);
  throw Error(path, "ending " + (ending.empty() ? "is missing" : "is " + ending) +
                        ", accepted .npz, .csv, .log and .hdf5");
}

}  // namespace blindcorner
