// SPDX-License-Identifier: Apache-2.0
/// NumPy's .npy and .npz, and what `export` writes.
#include <optional>
#include <utility>

#include "blindcorner/forward/error.h"
#include "io/capture_metadata.h"
#include "io/npy.h"
#include "io/npz.h"
#include "io/readers/arrays.h"
#include "io/readers/capture_reader.h"

namespace blindcorner {
namespace {

std::string counts_name(const NpzFile& archive, const std::string& path,
                        const ImportOptions& options) {
  if (!options.array.empty()) return options.array;
  if (archive.has("counts")) return "counts";
  if (archive.size() == 1) return archive.only_name();
  throw Error(path, "which array holds the counts has to be stated, found " + archive.names());
}

/// Metadata of this project's export, if the archive has them and the caller states no axes.
std::optional<CaptureFile> own_metadata(const NpzFile& archive, const std::string& path,
                                        const ImportOptions& options) {
  if (!options.axes.empty() || !archive.has("metadata_json")) return std::nullopt;
  const std::string where = path + ": array metadata_json";
  const NpyArray text = archive.read("metadata_json");
  if (!text.is_text) throw Error(where, "holds numbers, accepted one text");
  return parse_metadata(text.text, where);
}

void fill_own(CaptureFile& file, const NpyArray& array, const std::string& where) {
  const HistogramCube& first = file.captures.front().counts;
  const std::vector<std::size_t> expected{file.captures.size(),
                                          static_cast<std::size_t>(first.zones()),
                                          static_cast<std::size_t>(first.bins)};
  if (array.shape != expected) {
    NpyArray declared;
    declared.shape = expected;
    throw Error(where, "has shape " + array.shape_text() + ", but metadata_json declares " +
                           declared.shape_text());
  }
  auto next = array.values.cbegin();
  const auto size = static_cast<std::ptrdiff_t>(expected[1] * expected[2]);
  for (Capture& capture : file.captures) {
    capture.counts.values.assign(next, next + size);
    next += size;
  }
}

CaptureFile import_npz(const std::string& path, const ImportOptions& options, ImportNotes& notes) {
  const NpzFile archive(path);
  const std::string name = counts_name(archive, path, options);
  const std::string where = path + ": array " + name;
  const NpyArray array = read_numbers(archive, path, name);
  CaptureFile file;
  if (std::optional<CaptureFile> own = own_metadata(archive, path, options)) {
    file = std::move(*own);
    const HistogramCube& first = file.captures.front().counts;
    if (options.rows > 0 && (options.rows != first.rows || options.columns != first.columns)) {
      throw Error(where, "rows, columns: found " + std::to_string(options.rows) + " x " +
                             std::to_string(options.columns) + ", accepted: what the file says, " +
                             std::to_string(first.rows) + " x " + std::to_string(first.columns));
    }
    fill_own(file, array, where);
  } else {
    file.captures = arrange(array, options, where, notes);
  }
  if (!options.sensor_positions.empty()) {
    place_sensor(file.captures, read_numbers(archive, path, options.sensor_positions), options,
                 path + ": array " + options.sensor_positions);
  }
  return file;
}

CaptureFile import_npy(const ImportSource& source, const ImportOptions& options,
                       ImportNotes& notes) {
  if (!options.sensor_positions.empty()) {
    throw Error(source.path(),
                "sensor_positions names an array of a .npz, a .npy holds only one array");
  }
  CaptureFile file;
  file.captures = arrange(parse_npy(source.bytes(), source.path()), options, source.path(), notes);
  return file;
}

bool is_npy(const ImportSource& source) {
  return source.beginning().starts_with("\x93NUMPY") || source.ending() == ".npy";
}

bool recognise(const ImportSource& source) {
  return is_npy(source) || source.beginning().starts_with("PK\x03\x04") ||
         source.ending() == ".npz";
}

CaptureFile read(const ImportSource& source, const ImportOptions& options, ImportNotes& notes) {
  if (is_npy(source)) return import_npy(source, options, notes);
  return import_npz(source.path(), options, notes);
}

}  // namespace

CaptureReader numpy_reader() {
  return {
      .name = "numpy",
      .recognises = ".npy or .npz of NumPy, and what export writes",
      .assumes = "nothing: --axes states the order of the axes, what export wrote needs no option",
      .options = {"axes", "array", "sensor_positions", "axes_world", "rows"},
      .recognise = recognise,
      .read = read};
}

}  // namespace blindcorner
