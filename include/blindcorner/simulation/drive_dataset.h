// SPDX-License-Identifier: Apache-2.0
/// Training data sets as published for the street: frames of drives whose perception is told the
/// truth.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/io/drive_file.h"
#include "blindcorner/simulation/simulated_sensor.h"
#include "blindcorner/simulation/trials.h"

namespace blindcorner {

struct DriveDatasetOptions {
  int environments = 30;  ///< drives, each with its own places and photons
  std::uint64_t seed = 1;
  /// Captures of each frame, at most 100. The first capture shows the hidden objects that are
  /// there. The others show hidden objects elsewhere, out of direct sight, drawn anew for each
  /// capture as the drive file says.
  int places = 1;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// The drives of a data set, with the oracle, at the speeds of a drive file's trials. Their seeds
/// are far from the seeds of trials, so that no trial repeats a learnt world.
std::vector<Trial> plan_drive_dataset(const Drive& drive, const DriveDatasetOptions& options);

/// Captures of every frame of these drives until a hidden object comes in direct sight, with the
/// true pose of the object and the pose of the sensor. Drives are in order. Frames of a drive are
/// side by side, each with all its places. Worlds without a hidden object give no frames. `threads`
/// drives run at a time (0: one per processor). `advance` is called after each drive, one call at a
/// time. Throws Error if no frame is left.
std::vector<Capture> record_drives(const Drive& drive, const SimulatedSensor& sensor,
                                   const std::vector<Trial>& drives, int places = 1,
                                   int threads = 0, const std::function<void()>& advance = {});

}  // namespace blindcorner
