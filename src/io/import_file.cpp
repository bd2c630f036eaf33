// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/import_file.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <limits>
#include <utility>

#include "blindcorner/forward/error.h"
#include "io/capture_metadata.h"
#include "io/file_bytes.h"
#include "io/import_cheapspad.h"
#include "io/import_tmf8828.h"
#include "io/import_vl53l8ch.h"
#include "io/npy.h"
#include "io/npz.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;

/// VL53L8CH histograms as the person tracking data hold them (README of that data set).
constexpr double kPersonTrackingBinWidth = 250e-12;  // s

std::vector<std::string> split_list(const std::string& list) {
  std::vector<std::string> items;
  for (std::size_t begin = 0; begin <= list.size();) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    std::string item = list.substr(begin, end - begin);
    item.erase(0, std::min(item.find_first_not_of(' '), item.size()));
    item.erase(item.find_last_not_of(' ') + 1);
    items.push_back(std::move(item));
    begin = end + 1;
  }
  return items;
}

// ---- Order of axes ----

/// One named axis of an array in C order.
struct Axis {
  bool present = false;
  std::size_t extent = 1;
  std::size_t stride = 0;  ///< elements
};
struct Axes {
  Axis capture, row, column, zone, bin;

  Axis* find(const std::string& name) {
    if (name == "capture") return &capture;
    if (name == "row") return &row;
    if (name == "column") return &column;
    if (name == "zone") return &zone;
    if (name == "bin") return &bin;
    return nullptr;
  }
};

/// Names of the axes, checked for sense but not yet against an array.
std::vector<std::string> parse_axes(const std::string& text) {
  std::vector<std::string> names = split_list(text);
  Axes axes;
  for (const std::string& name : names) {
    Axis* axis = axes.find(name);
    if (axis == nullptr) {
      throw Error("axes", "found '" + name + "' in '" + text +
                              "', accepted a list of capture, row, column, zone and bin");
    }
    if (axis->present) throw Error("axes", name + " appears twice in '" + text + "'");
    axis->present = true;
  }
  if (!axes.bin.present) throw Error("axes", "bin is missing in '" + text + "'");
  if (axes.zone.present && (axes.row.present || axes.column.present)) {
    throw Error("axes", "zone stands for row and column, found both in '" + text + "'");
  }
  return names;
}

Axes bind_axes(const std::string& text, const NpyArray& array, const std::string& where) {
  const std::vector<std::string> names = parse_axes(text);
  if (names.size() != array.shape.size()) {
    throw Error(where, "has shape " + array.shape_text() + ", but axes '" + text + "' name " +
                           std::to_string(names.size()));
  }
  Axes axes;
  std::size_t stride = 1;
  for (std::size_t i = names.size(); i-- > 0;) {
    if (array.shape[i] == 0) throw Error(where, "is empty, its shape is " + array.shape_text());
    if (array.shape[i] > static_cast<std::size_t>(std::numeric_limits<int>::max())) {
      throw Error(where, "is too large, its shape is " + array.shape_text());
    }
    *axes.find(names[i]) = {true, array.shape[i], stride};
    stride *= array.shape[i];
  }
  return axes;
}

/// Rows and columns, from the array, the options or, failing both, a square.
std::pair<int, int> zone_layout(const Axes& axes, const ImportOptions& options,
                                const std::string& where, std::vector<std::string>& warnings) {
  if (!axes.zone.present) {
    const int rows = static_cast<int>(axes.row.extent);
    const int columns = static_cast<int>(axes.column.extent);
    if (options.rows != 0 && (options.rows != rows || options.columns != columns)) {
      throw Error(where, "has " + std::to_string(rows) + " x " + std::to_string(columns) +
                             " zones, but rows x columns are stated as " +
                             std::to_string(options.rows) + " x " +
                             std::to_string(options.columns));
    }
    return {rows, columns};
  }
  const int zones = static_cast<int>(axes.zone.extent);
  if (options.rows != 0) {
    if (static_cast<long long>(options.rows) * options.columns != zones) {
      throw Error(where, "has " + std::to_string(zones) + " zones, but rows x columns are " +
                             std::to_string(options.rows) + " x " +
                             std::to_string(options.columns));
    }
    return {options.rows, options.columns};
  }
  const int side = static_cast<int>(std::lround(std::sqrt(static_cast<double>(zones))));
  if (side * side != zones) {
    throw Error(where, "has " + std::to_string(zones) +
                           " zones, which is no square: rows and columns have to be stated");
  }
  if (side > 1) {
    warnings.push_back(where + ": taking " + std::to_string(zones) + " zones as " +
                       std::to_string(side) + " rows of " + std::to_string(side));
  }
  return {side, side};
}

std::vector<Capture> cut_captures(const NpyArray& array, const Axes& axes, int rows, int columns) {
  std::vector<Capture> captures(axes.capture.extent);
  for (std::size_t c = 0; c < captures.size(); ++c) {
    HistogramCube cube(rows, columns, static_cast<int>(axes.bin.extent));
    for (int z = 0; z < cube.zones(); ++z) {
      const std::size_t from =
          c * axes.capture.stride +
          (axes.zone.present ? static_cast<std::size_t>(z) * axes.zone.stride
                             : static_cast<std::size_t>(z / columns) * axes.row.stride +
                                   static_cast<std::size_t>(z % columns) * axes.column.stride);
      for (std::size_t k = 0; k < axes.bin.extent; ++k) {
        cube.zone(z)[k] = array.values[from + k * axes.bin.stride];
      }
    }
    captures[c].counts = std::move(cube);
  }
  return captures;
}

// ---- Sensor positions ----

/// Rows are the world axes in data coordinates. May be a reflection.
Eigen::Matrix3d parse_world_axes(const std::string& text) {
  const auto fail = [&text] {
    return Error("axes_world",
                 "found '" + text + "', accepted x, y and z in any order and with signs: z,-x,y");
  };
  const std::vector<std::string> items = split_list(text);
  if (items.size() != 3) throw fail();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < 3; ++i) {
    std::string name = items[i];
    const bool negative = name.starts_with('-');
    if (negative || name.starts_with('+')) name.erase(0, 1);
    if (name != "x" && name != "y" && name != "z") throw fail();
    axes(static_cast<Eigen::Index>(i), name[0] - 'x') = negative ? -1.0 : 1.0;
  }
  if (axes.determinant() == 0.0) throw fail();  // an axis appears twice
  return axes;
}

void place_sensor(std::vector<Capture>& captures, const NpyArray& positions,
                  const ImportOptions& options, const std::string& where) {
  const bool one = positions.shape == std::vector<std::size_t>{3} && captures.size() == 1;
  if (!one && positions.shape != std::vector<std::size_t>{captures.size(), 3}) {
    throw Error(where, "has shape " + positions.shape_text() + ", accepted (" +
                           std::to_string(captures.size()) + ", 3): a position for each capture");
  }
  const Eigen::Matrix3d axes = parse_world_axes(options.axes_world);
  for (std::size_t c = 0; c < captures.size(); ++c) {
    const Eigen::Vector3d position(&positions.values[3 * c]);
    if (!position.allFinite()) {
      throw Error(where, "row " + std::to_string(c) + " is not finite");
    }
    Transform pose = Transform::Identity();
    pose.linear() = options.sensor_rotation.normalized().toRotationMatrix();
    pose.translation() = axes * position;
    captures[c].T_world_sensor = pose;
  }
}

// ---- Numpy ----

std::string counts_name(const NpzFile& archive, const std::string& path,
                        const ImportOptions& options) {
  if (!options.array.empty()) return options.array;
  if (archive.has("counts")) return "counts";
  if (archive.size() == 1) return archive.only_name();
  throw Error(path, "which array holds the counts has to be stated, found " + archive.names());
}

NpyArray read_numbers(const NpzFile& archive, const std::string& path, const std::string& name) {
  NpyArray array = archive.read(name);
  if (array.is_text) throw Error(path + ": array " + name, "holds text, accepted numbers");
  return array;
}

/// Metadata of our own export, when the archive has them and the caller states no axes.
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

std::vector<Capture> arrange(const NpyArray& array, const ImportOptions& options,
                             const std::string& where, std::vector<std::string>& warnings) {
  if (array.is_text) throw Error(where, "holds text, accepted numbers");
  if (options.axes.empty()) {
    throw Error(where, "the order of its axes has to be stated for shape " + array.shape_text() +
                           ", for example capture,row,column,bin");
  }
  const Axes axes = bind_axes(options.axes, array, where);
  const auto [rows, columns] = zone_layout(axes, options, where, warnings);
  return cut_captures(array, axes, rows, columns);
}

CaptureFile import_npz(const std::string& path, const ImportOptions& options,
                       std::vector<std::string>& warnings) {
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
    file.captures = arrange(array, options, where, warnings);
  }
  if (!options.sensor_positions.empty()) {
    place_sensor(file.captures, read_numbers(archive, path, options.sensor_positions), options,
                 path + ": array " + options.sensor_positions);
  }
  return file;
}

CaptureFile import_npy(const std::string& path, const ImportOptions& options,
                       std::vector<std::string>& warnings) {
  if (!options.sensor_positions.empty()) {
    throw Error(path, "sensor_positions names an array of a .npz, a .npy holds only one array");
  }
  CaptureFile file;
  file.captures = arrange(parse_npy(read_bytes(path), path), options, path, warnings);
  return file;
}

CaptureFile import_numpy(const std::string& path, const ImportOptions& options,
                         std::vector<std::string>& warnings) {
  if (fs::path(path).extension() == ".npy") return import_npy(path, options, warnings);
  return import_npz(path, options, warnings);
}

// ---- ST person tracking ----

bool is_volume_name(const std::string& name) {
  return name.starts_with("volume_") && name.ends_with(".npz");
}

std::vector<std::string> volumes_in(const std::string& folder) {
  std::vector<std::string> files;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    if (is_volume_name(it->path().filename().string())) files.push_back(it->path().string());
  }
  if (error) throw Error(folder, "cannot be listed: " + error.message());
  if (files.empty()) throw Error(folder, "holds no files volume_NNNNNN.npz");
  std::sort(files.begin(), files.end());
  return files;
}

CaptureFile import_volume(const std::string& path, ImportOptions options) {
  const NpzFile archive(path);
  const NpyArray counts = read_numbers(archive, path, "hists");
  const NpyArray points = read_numbers(archive, path, "pt_cloud");
  options.axes = "zone,bin";
  std::vector<std::string> square_is_the_rule;
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
  file.bin_width = kPersonTrackingBinWidth;
  file.sensor = "vl53l8ch";
  file.description =
      "ST person tracking; world (x, y, z) is (x, -z, y) of the data; first bounce removed, bin 0 "
      "is "
      "light at the relay wall";
  return file;
}

// ---- Choice of format ----

ImportFormat detect(const std::string& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) return ImportFormat::st_person_tracking;
  const std::string ending = fs::path(path).extension().string();
  if (ending == ".npy") return ImportFormat::numpy;
  if (ending == ".npz") {
    const NpzFile archive(path);
    return archive.has("hists") && archive.has("pt_cloud") ? ImportFormat::st_person_tracking
                                                           : ImportFormat::numpy;
  }
  if (ending == ".mat") return ImportFormat::cheapspad;
  if (ending == ".exr") throw Error(path, "is a capture file already, nothing to import");
  const std::string text = read_bytes(path);
  if (text.find("#Raw,") != std::string::npos) return ImportFormat::tmf8828_log;
  if (is_vl53l8ch_log(text)) return ImportFormat::vl53l8ch_log;
  throw Error(path,
              "its format is not recognised, accepted .npy, .npz, .mat, TMF8828 logs (with #Raw "
              "lines), VL53L8CH logs (with D lines) and folders of volume_NNNNNN.npz");
}

CaptureFile import_log(const std::string& path, const ImportOptions& options,
                       std::vector<std::string>& warnings) {
  CaptureFile file;
  file.captures = parse_tmf8828_log(read_bytes(path), path, options, warnings);
  file.sensor = "tmf8828";
  return file;
}

/// An option that would have no effect is more likely a mistake than meant.
void refuse_numpy_options(const ImportOptions& options) {
  for (const auto& [name, value] :
       {std::pair{"axes", &options.axes}, std::pair{"array", &options.array},
        std::pair{"sensor_positions", &options.sensor_positions}}) {
    if (!value->empty()) {
      throw Error(name, "found '" + *value + "', but only numpy files have use for it");
    }
  }
}

CaptureFile import_one(const std::string& path, ImportFormat format, const ImportOptions& options,
                       std::vector<std::string>& warnings) {
  if (format != ImportFormat::numpy) refuse_numpy_options(options);
  switch (format) {
    case ImportFormat::tmf8828_log:
      return import_log(path, options, warnings);
    case ImportFormat::vl53l8ch_log: {
      CaptureFile file;
      file.captures = parse_vl53l8ch_log(read_bytes(path), path, options, warnings);
      file.sensor = "vl53l8ch";
      file.bin_width = kPersonTrackingBinWidth;
      return file;
    }
    case ImportFormat::cheapspad:
      return import_cheapspad(path, options, warnings);
    case ImportFormat::st_person_tracking:
      return import_volume(path, options);
    default:
      return import_numpy(path, options, warnings);
  }
}

/// Adds the captures of `part` to `all`, which they have to match.
void append(CaptureFile& all, CaptureFile part, const ImportOptions& options,
            const std::string& path) {
  for (std::size_t i = 0; i < part.captures.size(); ++i) {
    part.captures[i].source = path;
    part.captures[i].index = static_cast<int>(i);
  }
  if (all.captures.empty()) {
    all = std::move(part);
    return;
  }
  const auto extent = [](const HistogramCube& c) {
    return std::to_string(c.rows) + " x " + std::to_string(c.columns) + " x " +
           std::to_string(c.bins);
  };
  const std::string found = extent(part.captures.front().counts);
  const std::string expected = extent(all.captures.front().counts);
  if (found != expected) {
    throw Error(path,
                "has " + found + " rows x columns x bins, the files before it have " + expected);
  }
  if (part.bin_width != all.bin_width && options.bin_width == 0) {
    const auto width = [](double seconds) {
      return seconds > 0 ? std::to_string(seconds * 1e12) + " ps" : std::string("unknown width");
    };
    throw Error(path, "has bins of " + width(part.bin_width) + ", the files before it of " +
                          width(all.bin_width));
  }
  std::move(part.captures.begin(), part.captures.end(), std::back_inserter(all.captures));
}

void apply_overrides(CaptureFile& file, const ImportOptions& options) {
  if (options.bin_width > 0.0) file.bin_width = options.bin_width;
  if (!options.sensor.empty()) file.sensor = options.sensor;
  if (!options.description.empty()) file.description = options.description;
  for (Capture& capture : file.captures) {
    if (options.exposures) capture.exposures = *options.exposures;
    if (options.dispersion) capture.dispersion = options.dispersion;
  }
}

}  // namespace

void ImportOptions::validate() const {
  const auto check = [](bool good, const char* field, double found, const char* accepted) {
    if (!good) throw Error(field, "found " + std::to_string(found) + ", accepted " + accepted);
  };
  const auto positive = [](double value) { return value > 0.0 && std::isfinite(value); };
  if (!axes.empty()) parse_axes(axes);
  parse_world_axes(axes_world);
  check(rows >= 0, "rows", rows, "1 or more, 0 for unstated");
  check(columns >= 0, "columns", columns, "1 or more, 0 for unstated");
  if ((rows == 0) != (columns == 0)) {
    throw Error(rows == 0 ? "rows" : "columns", "is missing, rows and columns go together");
  }
  check(bin_width == 0.0 || positive(bin_width), "bin_width", bin_width,
        "a finite number of seconds > 0, 0 for unstated");
  if (exposures) check(positive(*exposures), "exposures", *exposures, "a finite number > 0");
  if (dispersion) check(positive(*dispersion), "dispersion", *dispersion, "a finite number > 0");
  check(sensor_rotation.norm() > 1e-9 && sensor_rotation.coeffs().allFinite(), "sensor_rotation",
        sensor_rotation.norm(), "a quaternion of length 1");
  check(repeats_per_sample >= 0, "repeats_per_sample", repeats_per_sample,
        "1 or more, 0 for all of a position");
  check(i2c_address >= 0 && i2c_address < 128, "i2c_address", i2c_address,
        "1 to 127, 0 for the only one");
}

CaptureFile import_captures(const std::vector<std::string>& paths, const ImportOptions& options,
                            std::vector<std::string>* warnings) {
  options.validate();
  if (paths.empty()) throw Error("import", "no files were named");
  std::vector<std::string> unheard;
  std::vector<std::string>& notes = warnings != nullptr ? *warnings : unheard;
  CaptureFile all;
  for (const std::string& path : paths) {
    const ImportFormat format =
        options.format == ImportFormat::automatic ? detect(path) : options.format;
    std::error_code error;
    const bool folder = format == ImportFormat::st_person_tracking && fs::is_directory(path, error);
    for (const std::string& file : folder ? volumes_in(path) : std::vector<std::string>{path}) {
      append(all, import_one(file, format, options, notes), options, file);
    }
  }
  apply_overrides(all, options);
  return all;
}

}  // namespace blindcorner
