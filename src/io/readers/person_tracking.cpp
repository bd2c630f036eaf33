// SPDX-License-Identifier: Apache-2.0
/// The ST person tracking data (Somasundaram et al. 2026): volume_NNNNNN.npz with `hists` and
/// `pt_cloud`, or a folder of them.
#include <algorithm>
#include <filesystem>

#include "blindcorner/forward/error.h"
#include "io/npz.h"
#include "io/readers/arrays.h"
#include "io/readers/capture_reader.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;

/// VL53L8CH histograms as the person tracking data hold them (README of that data set).
constexpr double kBinWidth = 250e-12;  // s

bool is_volume_name(const std::string& name) {
  return name.starts_with("volume_") && name.ends_with(".npz");
}

std::vector<std::string> volumes_in(const ImportSource& source) {
  std::vector<std::string> files;
  std::error_code error;
  for (fs::directory_iterator it(source.path(), error), end; !error && it != end;
       it.increment(error)) {
    if (is_volume_name(it->path().filename().string())) files.push_back(it->path().string());
  }
  if (error) throw Error(source.path(), "cannot be listed: " + error.message());
  std::sort(files.begin(), files.end());
  return files;
}

bool recognise(const ImportSource& source) {
  if (source.is_folder()) return !volumes_in(source).empty();
  if (!source.beginning().starts_with("PK\x03\x04")) return false;
  const NpzFile archive(source.path());
  return archive.has("hists") && archive.has("pt_cloud");
}

CaptureFile read(const ImportSource& source, const ImportOptions& given, ImportNotes&) {
  const std::string& path = source.path();
  const NpzFile archive(path);
  const NpyArray counts = read_numbers(archive, path, "hists");
  const NpyArray points = read_numbers(archive, path, "pt_cloud");
  ImportOptions options = given;
  options.axes = "zone,bin";
  ImportNotes square_is_the_rule;
  CaptureFile file;
  file.captures = arrange(counts, options, path + ": array hists", square_is_the_rule);
  Capture& capture = file.captures.front();
  const std::size_t zones = static_cast<std::size_t>(capture.counts.zones());
  if (points.shape != std::vector<std::size_t>{zones, 3}) {
    throw Error(path + ": array pt_cloud", "has shape " + points.shape_text() + ", accepted (" +
                                               std::to_string(zones) + ", 3): a point per zone");
  }
  capture.relay_points.emplace();
  for (std::size_t z = 0; z < zones; ++z) {
    const double* p = &points.values[3 * z];
    capture.relay_points->emplace_back(p[0], -p[2], p[1]);  // y up to z up, a rotation
  }
  file.bin_width = kBinWidth;
  file.sensor = "vl53l8ch";
  file.description =
      "ST person tracking; world (x, y, z) is (x, -z, y) of the data; first bounce removed, bin 0 "
      "is "
      "light at the relay wall";
  return file;
}

}  // namespace

CaptureReader person_tracking_reader() {
  return {.name = "st_person_tracking",
          .recognises = "volume_NNNNNN.npz with hists and pt_cloud, or a folder of them",
          .assumes = "bins of 250 ps, bin 0 is light at the relay wall, y of the points is up",
          .options = {"rows"},
          .recognise = recognise,
          .read = read,
          .files = volumes_in};
}

}  // namespace blindcorner
