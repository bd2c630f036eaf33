// SPDX-License-Identifier: Apache-2.0
/// Captures named on the command line.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/forward/sensor/sensor.h"
#include "blindcorner/forward/transport/forward_model.h"

namespace blindcorner {

/// One capture, or why a file holds none.
struct CaptureInput {
  std::optional<Capture> capture;
  std::string source;
  int index = -1;     ///< place in the file; -1: the file as a whole
  std::string error;  ///< empty when there is a capture
};

/// Files in the order given; a directory stands for the .exr files in it, sorted by name. Throws
/// Error for a directory without any.
std::vector<std::string> expand_directories(const std::vector<std::string>& paths);

/// All captures of all files. A file that cannot be read, or whose bins are stated to be more than
/// one per cent wider or narrower than `bin_width` (s), gives inputs with an error instead.
std::vector<CaptureInput> read_capture_inputs(const std::vector<std::string>& paths,
                                              double bin_width);

/// Keeps the inputs that `text` names: places from 0 over all files in their order, as
/// "0-9,12,20-". Throws Error when the text cannot be read, or names a place that does not exist.
void choose_captures(std::vector<CaptureInput>& inputs, const std::string& text);

/// Throws Error with the first reason when no input has a capture.
void require_readable(const std::vector<CaptureInput>& inputs);

/// The captures of all files, in their order. Throws Error with the reason when one is missing.
std::vector<Capture> read_all_captures(const std::vector<std::string>& paths, const Scene& scene);

/// Placement of the scene's sensor or, with a capture file (empty: none), that of the file's first
/// capture. Throws Error if there is no file and the scene leaves it to captures where its zones
/// look.
SensorPlacement known_placement(const Scene& scene, const std::string& capture_path);

/// Throws Error where the name of a capture file to write ends in anything but .exr.
void require_exr(const std::string& path);

}  // namespace blindcorner
