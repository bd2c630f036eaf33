// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/drive_dataset.h"

#include "blindcorner/forward/error.h"
#include "blindcorner/simulation/drive_loop.h"

namespace blindcorner {
namespace {

/// Trials count their seeds from 1, those with injected errors from a million.
constexpr std::uint64_t kDatasetSeeds = 1'000'000'000;

std::vector<Capture> captures_of(const Drive& drive, const DriveResult& driven) {
  const std::vector<std::string> names = unknown_names(drive.scene);
  std::vector<Capture> captures;
  for (const DriveFrame& frame : driven.frames) {
    if (frame.fate != FrameFate::used || !frame.counts || !frame.truth) continue;
    Capture capture;
    capture.counts = *frame.counts;
    capture.T_world_sensor = frame.T_world_sensor;
    for (std::size_t i = 0; i < names.size(); ++i) {
      capture.truth[names[i]] = (*frame.truth)[static_cast<Eigen::Index>(i)];
    }
    captures.push_back(std::move(capture));
  }
  return captures;
}

}  // namespace

void DriveDatasetOptions::validate() const {
  if (environments >= 1) return;
  throw Error("environments", "found " + std::to_string(environments) + ", accepted: >= 1");
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
                                   const std::vector<Trial>& drives, int threads,
                                   const std::function<void()>& advance) {
  std::vector<std::vector<Capture>> frames(drives.size());
  const auto record = [&](const Trial& trial) {
    const std::size_t place = static_cast<std::size_t>(trial.seed - drives.front().seed);
    frames[place] = captures_of(drive, drive_through(drive, sensor, options_of(trial)));
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
