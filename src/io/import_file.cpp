// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/import_file.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <utility>

#include "blindcorner/forward/error.h"
#include "io/readers/arrays.h"
#include "io/readers/capture_reader.h"
#include "io/readers/text_table.h"

namespace blindcorner {
namespace {

/// The reader of that name. Throws Error that lists the names.
const CaptureReader& named_reader(const std::string& name) {
  std::string names = "auto";
  for (const CaptureReader& reader : capture_readers()) {
    if (reader.name == name) return reader;
    names += ", " + std::string(reader.name);
  }
  throw Error("format", "found '" + name + "', accepted " + names);
}

bool is_ros_bag(const ImportSource& source) {
  for (const char* ending : {".bag", ".db3", ".mcap"}) {
    if (source.ending() == ending) return true;
  }
  return source.is_folder() &&
         std::filesystem::exists(std::filesystem::path(source.path()) / "metadata.yaml");
}

/// The reader that recognises a file. Throws Error that lists what each of them reads.
const CaptureReader& recognising_reader(const ImportSource& source) {
  if (source.ending() == ".exr" || source.beginning().starts_with("\x76\x2f\x31\x01")) {
    throw Error(source.path(), "is a capture file already, nothing to import");
  }
  if (is_ros_bag(source)) {
    throw Error(source.path(),
                "is a ROS bag, accepted: in Python, blindcorner.import_captures (docs/python.md)");
  }
  std::string accepted;
  for (const CaptureReader& reader : capture_readers()) {
    if (reader.recognise(source)) return reader;
    accepted += (accepted.empty() ? "" : "; ") + std::string(reader.name) + ": " +
                std::string(reader.recognises);
  }
  throw Error(source.path(), "its format is not recognised, accepted " + accepted);
}

const CaptureReader& choose_reader(const ImportSource& source, const ImportOptions& options) {
  if (options.format != "auto") return named_reader(options.format);
  if (!options.pattern.empty()) return named_reader("table");
  return recognising_reader(source);
}

/// An option that would have no effect is more likely a mistake than meant.
void refuse_options_without_effect(const CaptureReader& reader, const ImportOptions& options) {
  const auto number = [](int value) { return value == 0 ? "" : std::to_string(value); };
  for (const auto& [name, value] :
       {std::pair<const char*, std::string>{"axes", options.axes},
        {"array", options.array},
        {"sensor_positions", options.sensor_positions},
        {"pattern", options.pattern},
        {"rows", number(options.rows)},
        {"i2c_address", number(options.i2c_address)},
        {"repeats", number(options.repeats_per_sample)},
        {"published_filter", number(static_cast<int>(options.published_filter))}}) {
    if (value.empty() || std::ranges::count(reader.options, name) > 0) continue;
    throw Error(name, "found '" + value + "', but the reader of format " +
                          std::string(reader.name) + " has no use for it");
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
  if (!axes.empty()) check_axes(axes);
  check_world_axes(axes_world);
  if (!pattern.empty()) check_pattern(pattern);
  if (format != "auto") named_reader(format);
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

std::vector<ImportReader> import_readers() {
  std::vector<ImportReader> readers;
  for (const CaptureReader& reader : capture_readers()) {
    readers.push_back(
        {std::string(reader.name), std::string(reader.recognises), std::string(reader.assumes)});
  }
  return readers;
}

CaptureFile import_captures(const std::vector<std::string>& paths, const ImportOptions& options,
                            std::vector<std::string>* warnings) {
  options.validate();
  if (paths.empty()) throw Error("import", "no files were named");
  std::vector<std::string> unheard;
  ImportNotes& notes = warnings != nullptr ? *warnings : unheard;
  CaptureFile all;
  for (const std::string& path : paths) {
    const ImportSource source(path);
    const CaptureReader& reader = choose_reader(source, options);
    refuse_options_without_effect(reader, options);
    if (!source.is_folder()) {
      append(all, reader.read(source, options, notes), options, path);
      continue;
    }
    if (reader.files == nullptr) throw Error(path, "is a folder, accepted: a file");
    const std::vector<std::string> files = reader.files(source);
    if (files.empty()) {
      throw Error(path, "holds none of its files: " + std::string(reader.recognises));
    }
    for (const std::string& file : files) {
      append(all, reader.read(ImportSource(file), options, notes), options, file);
    }
  }
  apply_overrides(all, options);
  return all;
}

}  // namespace blindcorner
