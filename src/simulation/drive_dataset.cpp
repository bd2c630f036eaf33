// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/drive_dataset.h"

#include <algorithm>
#include <iterator>
#include <limits>

#include "blindcorner/forward/error.h"
#include "blindcorner/planner/grid/line_of_sight.h"
#include "blindcorner/simulation/drive_loop.h"
#include "blindcorner/simulation/true_world.h"
#include "simulation/drive_setup.h"

namespace blindcorner {
namespace {

/// Seeds of these drives begin here. Trials count their seeds from 1, those with injected errors
/// from a million.
constexpr std::uint64_t kDatasetSeeds = 1'000'000'000;

/// Seeds of a frame's captures begin this far from those of the frame before. No drive has so many
/// frames that its seeds meet another drive's.
constexpr std::uint64_t kSeedsApart = 1'000;
constexpr std::uint64_t kDriveSeeds = 1'000'000'000;
/// Places that are tried before a frame makes do with fewer.
constexpr int kAttempts = 200;
constexpr int kMaxPlaces = 100;

/// Drives, and senses the frames on the way.
class Recorder {
 public:
  Recorder(const Drive& drive, const SimulatedSensor& sensor, int places)
      : drive_(drive),
        sensor_(sensor),
        places_(places),
        sight_(drive.scene, drive.map, sight_options(drive)) {}

  /// Captures of the frames in which no hidden object is, or was before, in sight.
  std::vector<Capture> record(const Trial& trial) const {
    DriveOptions options = options_of(trial);
    options.keep_pictures = false;  // nothing is sensed: the oracle needs no histograms
    const DriveResult driven = drive_through(drive_, sensor_, options);
    std::vector<Capture> captures;
    std::uint64_t seed = kDriveSeeds * trial.seed;
    for (const DriveFrame& frame : driven.frames) {
      seed += kSeedsApart;
      if (frame.fate != FrameFate::used || !frame.truth) continue;
      std::ranges::move(sensor_.sense_each(frame.T_world_sensor, poses_of(frame, seed), seed),
                        std::back_inserter(captures));
    }
    return captures;
  }

 private:
  /// Where the hidden objects are, and where they might have been out of sight.
  std::vector<PoseVector> poses_of(const DriveFrame& frame, std::uint64_t seed) const {
    std::vector<PoseVector> poses{*frame.truth};
    const auto wanted = static_cast<std::size_t>(places_);
    for (std::uint64_t i = 1; i <= kAttempts && poses.size() < wanted; ++i) {
      const TrueWorld world(drive_, seed + i);
      const auto pose = world.hidden(frame.time);
      if (!pose) continue;
      const auto scan = sight_.scan(frame.T_world_sensor, world.placements(frame.time));
      if (scan.object_hits.empty()) poses.push_back(*pose);
    }
    return poses;
  }

  const Drive& drive_;
  const SimulatedSensor& sensor_;
  int places_;
  LineOfSight sight_;
};

}  // namespace

void DriveDatasetOptions::validate() const {
  const auto check = [](const char* field, int value, int most) {
    if (value >= 1 && value <= most) return;
    throw Error(field,
                "found " + std::to_string(value) + ", accepted: 1 to " + std::to_string(most));
  };
  check("environments", environments, std::numeric_limits<int>::max());
  check("places", places, kMaxPlaces);
}

std::vector<Trial> plan_drive_dataset(const Drive& drive, const DriveDatasetOptions& options) {
  options.validate();
  TrialsOptions trials;
  trials.trials = options.environments;
  trials.perceptions = {"oracle"};
  trials.seed = kDatasetSeeds + options.seed;
  return plan_trials(drive, trials);
}

std::vector<Capture> record_drives(const Drive& drive, const SimulatedSensor& sensor,
                                   const std::vector<Trial>& drives, int places, int threads,
                                   const std::function<void()>& advance) {
  std::vector<std::vector<Capture>> frames(drives.size());
  const Recorder recorder(drive, sensor, places);
  const auto record = [&](const Trial& trial) {
    const std::size_t place = static_cast<std::size_t>(trial.seed - drives.front().seed);
    frames[place] = recorder.record(trial);
    TrialResult result;
    result.trial = trial;
    return result;
  };
  run_trials(drives, threads, record, [&](const TrialResult& /*result*/) {
    if (advance) advance();
  });
  std::vector<Capture> captures;
  for (std::vector<Capture>& drive_frames : frames) {
    for (Capture& capture : drive_frames) {
      capture.index = static_cast<int>(captures.size());
      captures.push_back(std::move(capture));
    }
  }
  if (captures.empty()) {
    throw Error(drive.path, "no frame of " + std::to_string(drives.size()) +
                                " drives shows a hidden object's light only, accepted: a drive "
                                "whose object is there and not in sight from the start");
  }
  return captures;
}

}  // namespace blindcorner
