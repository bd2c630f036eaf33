// SPDX-License-Identifier: Apache-2.0
/// A study of trials in a directory: the work of `blindcorner trials`, for programs that spread it
/// over threads or machines.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "blindcorner/simulation/perception_networks.h"
#include "blindcorner/simulation/trial_journal.h"
#include "blindcorner/simulation/trials.h"

namespace blindcorner {

/// What a study is asked to do.
struct TrialRequest {
  std::string drive;                 ///< path of the drive file
  double light = 0;                  ///< factor on the laser's light; 0: the drive file's value
  std::vector<std::string> weights;  ///< files, for perceptions that are networks
  TrialsOptions options;
};

/// Drives trials and keeps the data that all of them share. Thread safe.
class TrialRunner {
 public:
  /// Reads the drive file, its scene and the weights. Throws Error.
  explicit TrialRunner(const TrialRequest& request);

  /// The same trial has the same result, apart from the run time.
  TrialResult run(const Trial& trial) const;

  const Drive& drive() const { return drive_; }
  const SimulatedSensor& sensor() const { return sensor_; }
  const std::shared_ptr<const Fitter>& fitter() const { return fitter_; }
  const PerceptionNetworks& networks() const { return networks_; }
  const std::map<std::string, std::string>& weight_files() const { return files_; }
  /// JSON of everything that the results depend on (trial_study).
  const std::string& study() const { return study_; }

 private:
  Drive drive_;
  std::map<std::string, std::string> files_;
  PerceptionNetworks networks_;
  std::string study_;
  SimulatedSensor sensor_;
  std::shared_ptr<const Fitter> fitter_;
};

/// A study and its directory: journal, tables and pages. One process at a time; only run() is
/// thread safe.
class TrialStudy {
 public:
  /// Opens the study of a directory, or begins it and makes the directory. Throws Error if the
  /// directory holds another study, or if another process works on it.
  TrialStudy(const TrialRequest& request, const std::string& directory);

  const Drive& drive() const { return runner_.drive(); }
  const std::string& study() const { return runner_.study(); }
  /// Trials without a result, in the order of their plan.
  std::vector<Trial> open() const;
  TrialResult run(const Trial& trial) const { return runner_.run(trial); }
  /// Adds a result durably, unless the trial already has one. Throws Error.
  void add(const TrialResult& result);
  /// Results in the order in which files list them.
  std::vector<TrialResult> results() const;

  /// Writes limits.json, unless it exists or the drive file does not say who is met
  /// (drive_limits.h).
  void write_limits() const;
  /// Writes trials.csv, and errors.csv if trials have injected errors.
  void write_tables() const;
  /// Failed trials whose page does not exist yet, among the first `most` failed trials of each
  /// perception.
  std::vector<Trial> missing_replays(int most) const;
  void write_replay(const Trial& trial) const;
  /// Trials whose drives are not kept yet, of the `most` seeds that tell most (telling_seeds) and
  /// of the two perceptions that the page plays side by side.
  std::vector<Trial> missing_pairs(int most) const;
  /// Drives a trial and keeps the data that the page needs to play it.
  void keep_for_pair(const Trial& trial) const;
  /// Writes trials.html.
  void write_page() const;

 private:
  nlohmann::json kept_pairs() const;
  nlohmann::json limits() const;

  std::string directory_;
  TrialRequest request_;
  TrialRunner runner_;
  TrialJournal journal_;
  std::set<std::pair<std::string, std::uint64_t>> known_;  ///< trials of the journal
};

}  // namespace blindcorner
