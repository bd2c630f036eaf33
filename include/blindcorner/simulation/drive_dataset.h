// SPDX-License-Identifier: Apache-2.0
/// Data sets to learn from as published for the street: frames of drives whose perception is told
/// the truth.
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
  int environments = 30;  ///< drives, each with places and photons of its own
  std::uint64_t seed = 1;
  /// Captures of each frame: the first of what is there, the others of hidden objects elsewhere,
  /// drawn anew for each as the drive file says and out of direct sight. At most 100.
  int places = 1;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// The drives of a data set: by the oracle, at the speeds of a drive file's trials. Their seeds are
/// far from those of trials, so that no trial repeats a world that was learnt.
std::vector<Trial> plan_drive_dataset(const Drive& drive, const DriveDatasetOptions& options);

/// Every frame of these drives until a hidden object comes in direct sight, with the object's true
/// pose and the sensor's; frames of a drive side by side, each with all its places, drives in
/// order. Worlds without a hidden object have none. `threads` drives run at a time (0: one per
/// processor). `advance` is called after each drive, one call at a time. Throws Error where no
/// frame is left.
std::vector<Capture> record_drives(const Drive& drive, const SimulatedSensor& sensor,
                                   const std::vector<Trial>& drives, int places = 1,
                                   int threads = 0, const std::function<void()>& advance = {});

}  // namespace blindcorner
