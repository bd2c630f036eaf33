// SPDX-License-Identifier: Apache-2.0
/// Finished results of a study of trials, on disk, so that the study can go on after it was killed.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/simulation/trials.h"

namespace blindcorner {

/// `trials.json` says which study a directory holds. `journal.csv` holds a line for each finished
/// trial, in the order in which the trials ended. A line is on disk before the next one begins. A
/// torn last line is dropped. Only one process at a time may work on a study.
class TrialJournal {
 public:
  /// Opens or begins the study in an existing directory. `study` describes, as JSON, all that
  /// results depend on. Throws Error if the directory holds another study, another process works on
  /// it, or a line cannot be read.
  TrialJournal(const std::string& directory, const std::string& study);
  ~TrialJournal();
  TrialJournal(const TrialJournal&) = delete;
  TrialJournal& operator=(const TrialJournal&) = delete;

  const std::vector<TrialResult>& results() const { return results_; }

  /// Adds a finished trial, durably. Throws Error.
  void add(const TrialResult& result);

 private:
  void read(const std::string& bytes);

  std::string path_;
  int descriptor_ = -1;
  std::vector<TrialResult> results_;
};

/// Converts a result to a line of the journal, with its end of line, and back. Throws Error for a
/// line that is not a result. A result from another machine is added as that machine wrote it.
std::string journal_line(const TrialResult& result);
TrialResult parse_journal_line(const std::string& line);

/// FNV-1a hash of a file's bytes, 64 bits, to notice that the file has changed.
std::string content_hash(const std::string& bytes);

/// Describes the study of a drive: hashes of drive file and scene file, and all else that changes
/// results. Neither perceptions nor the number of trials change results: both may grow from one run
/// to the next.
std::string trial_study(const Drive& drive, const std::string& scene_bytes, std::uint64_t seed);

/// trials.csv, of trials without injected errors:
/// `perception,zone,seed,speed_m_per_s,outcome,clearance_m,time_s,length_m`, then
/// `mean_speed_m_per_s` if the drive has a corner, then
/// `risk,present,impact_m_per_s,hardest_braking_m_per_s2`. A zone is written with both ends, m/s.
std::string trials_csv(const DriveTrials& trials, const std::vector<TrialResult>& results);
/// errors.csv, of trials with injected errors: the same columns, and `error_m` after `length_m`.
std::string errors_csv(const DriveTrials& trials, const std::vector<TrialResult>& results);

}  // namespace blindcorner
