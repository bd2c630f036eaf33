// SPDX-License-Identifier: Apache-2.0
/// A study of trials in a directory: what `blindcorner trials` does, for whoever spreads it over
/// threads or machines.
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

/// What is asked.
struct TrialRequest {
  std::string drive;                 ///< path of the drive file
  double light = 0;                  ///< factor on the laser's light; 0: the drive file's
  std::vector<std::string> weights;  ///< files, for perceptions that are networks
  TrialsOptions options;
};

/// Drives trials; keeps what all of them share. Thread safe.
class TrialRunner {
 public:
  /// Reads the drive file, its scene and the weights. Throws Error.
  explicit TrialRunner(const TrialRequest& request);

  /// The same trial has the same result, run time excepted.
  TrialResult run(const Trial& trial) const;

  const Drive& drive() const { return drive_; }
  const SimulatedSensor& sensor() const { return sensor_; }
  const std::shared_ptr<const Fitter>& fitter() const { return fitter_; }
  const PerceptionNetworks& networks() const { return networks_; }
  const std::map<std::string, std::string>& weight_files() const { return files_; }
  /// JSON of all that results depend on (trial_study).
  const std::string& study() const { return study_; }

 private:
  Drive drive_;
  std::map<std::string, std::string> files_;
  PerceptionNetworks networks_;
  std::string study_;
  SimulatedSensor sensor_;
  std::shared_ptr<const Fitter> fitter_;
};

/// A study and its directory: journal, tables and pages. One process at a time; not thread safe but
/// for run().
class TrialStudy {
 public:
  /// Opens the study of a directory, or begins it; the directory is made. Throws Error where it
  /// holds another study, or another process works on it.
  TrialStudy(const TrialRequest& request, const std::string& directory);

  const Drive& drive() const { return runner_.drive(); }
  const std::string& study() const { return runner_.study(); }
  /// Trials without a result, in the order of their plan.
  std::vector<Trial> open() const;
  TrialResult run(const Trial& trial) const { return runner_.run(trial); }
  /// Adds a result durably; one that is there already is not added again. Throws Error.
  void add(const TrialResult& result);
  /// In the order of files.
  std::vector<TrialResult> results() const;

  /// limits.json, unless it is there, or the drive file does not say who is met (drive_limits.h).
  void write_limits() const;
  /// trials.csv, and errors.csv where trials have injected errors.
  void write_tables() const;
  /// Failed trials, at most `most` of each perception, whose page is not there yet.
  std::vector<Trial> missing_replays(int most) const;
  void write_replay(const Trial& trial) const;
  /// Trials of the `most` seeds that tell most (telling_seeds), of the two perceptions that the
  /// page plays side by side, whose drives are not kept yet.
  std::vector<Trial> missing_pairs(int most) const;
  /// Drives a trial and keeps what the page plays of it.
  void keep_for_pair(const Trial& trial) const;
  /// trials.html.
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
