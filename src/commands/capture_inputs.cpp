// SPDX-License-Identifier: Apache-2.0
#include "commands/capture_inputs.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <sstream>
#include <string_view>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/batch.h"
#include "blindcorner/io/capture_file.h"

namespace blindcorner {

namespace {

namespace fs = std::filesystem;

std::vector<std::string> files_in(const std::string& directory) {
  std::vector<std::string> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory)) {
    if (entry.is_regular_file() && entry.path().extension() == ".exr") {
      files.push_back(entry.path().string());
    }
  }
  if (files.empty()) throw Error(directory, "holds no .exr file, accepted: at least one");
  std::ranges::sort(files);
  return files;
}

void read_into(const std::string& path, double bin_width, std::vector<CaptureInput>& inputs) {
  try {
    CaptureFile file = read_captures(path);
    const std::string problem = bin_width_problem(file.bin_width, bin_width);
    for (Capture& capture : file.captures) {
      CaptureInput input{std::nullopt, capture.source, capture.index, problem};
      if (problem.empty()) input.capture = std::move(capture);
      inputs.push_back(std::move(input));
    }
  } catch (const std::exception& error) {
    inputs.push_back({std::nullopt, path, -1, error.what()});
  }
}

/// The whole number that a text consists of. Empty: the text is anything else.
std::optional<std::size_t> whole_number(std::string_view text) {
  std::size_t value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || code != std::errc() || end != text.data() + text.size()) return {};
  return value;
}

}  // namespace

void choose_captures(std::vector<CaptureInput>& inputs, const std::string& text) {
  const std::size_t count = inputs.size();
  const auto refuse = [&](const std::string& part) {
    return Error("--captures", "found \"" + part + "\", accepted: places from 0 to " +
                                   std::to_string(count - 1) + ", as 0-9,12,20-");
  };
  std::vector<bool> wanted(count);
  std::istringstream parts(text + ",");
  for (std::string part; std::getline(parts, part, ',');) {
    const std::size_t dash = part.find('-');
    const auto first = whole_number(std::string_view(part).substr(0, dash));
    auto last = first;
    if (dash != std::string::npos) {
      const std::string_view end = std::string_view(part).substr(dash + 1);
      last = end.empty() ? count - 1 : whole_number(end);
    }
    if (!first || !last || *first > *last || *last >= count) throw refuse(part);
    std::fill(wanted.begin() + static_cast<std::ptrdiff_t>(*first),
              wanted.begin() + static_cast<std::ptrdiff_t>(*last) + 1, true);
  }
  std::vector<CaptureInput> chosen;
  for (std::size_t i = 0; i < count; ++i) {
    if (wanted[i]) chosen.push_back(std::move(inputs[i]));
  }
  inputs = std::move(chosen);
}

std::vector<std::string> expand_directories(const std::vector<std::string>& paths) {
  std::vector<std::string> files;
  for (const std::string& path : paths) {
    std::error_code code;
    if (!fs::is_directory(path, code)) {
      files.push_back(path);
      continue;
    }
    const std::vector<std::string> found = files_in(path);
    files.insert(files.end(), found.begin(), found.end());
  }
  return files;
}

std::vector<CaptureInput> read_capture_inputs(const std::vector<std::string>& paths,
                                              double bin_width) {
  std::vector<CaptureInput> inputs;
  for (const std::string& path : expand_directories(paths)) read_into(path, bin_width, inputs);
  return inputs;
}

void require_readable(const std::vector<CaptureInput>& inputs) {
  const auto readable = [](const CaptureInput& input) { return input.capture.has_value(); };
  if (std::ranges::any_of(inputs, readable)) return;
  if (inputs.empty()) throw Error("no captures in the files given");
  const CaptureInput& first = inputs.front();
  const std::string reason =
      first.error.starts_with(first.source) ? first.error : first.source + ": " + first.error;
  throw Error("no capture is readable: " + reason);
}

std::vector<Capture> read_all_captures(const std::vector<std::string>& paths, const Scene& scene) {
  std::vector<CaptureInput> inputs = read_capture_inputs(paths, scene.sensor.bin_width);
  require_readable(inputs);
  std::vector<Capture> captures;
  for (CaptureInput& input : inputs) {
    if (!input.capture) {
      throw Error(input.error.starts_with(input.source) ? input.error
                                                        : input.source + ": " + input.error);
    }
    captures.push_back(std::move(*input.capture));
  }
  return captures;
}

SensorPlacement known_placement(const Scene& scene, const std::string& capture_path) {
  if (!capture_path.empty()) {
    const CaptureFile file = read_captures(capture_path);
    return sensor_placement(scene, &file.captures.front());
  }
  SensorPlacement sensor = sensor_placement(scene);
  const bool known =
      std::ranges::all_of(sensor.relay_points, [](const auto& p) { return p.allFinite(); });
  if (!known) {
    throw Error(scene_place(scene) + ": sensor.zones",
                "found \"from_capture\", accepted: with --capture FILE, whose first capture says "
                "where the zones look");
  }
  return sensor;
}

void require_exr(const std::string& path) {
  if (std::filesystem::path(path).extension() != ".exr") {
    throw Error("--output", "found " + path + ", accepted: a name that ends in .exr");
  }
}

}  // namespace blindcorner
