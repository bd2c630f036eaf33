// SPDX-License-Identifier: Apache-2.0
/// What a study of trials has done so far, on disk, so that it can go on after it was killed.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/simulation/trials.h"

namespace blindcorner {

/// `trials.json` says which study a directory holds, `journal.csv` holds a line for each finished
/// trial in the order in which they ended. A line is on disk before the next one begins; a torn
/// last line is dropped. One process at a time.
class TrialJournal {
 public:
  /// Opens or begins the study in a directory that exists. `study` describes all that results
  /// depend on, as JSON. Throws Error where the directory holds another study, another process
  /// works on it, or a line cannot be read.
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

/// A result as a line of the journal, with its end of line, and back; throws Error for a line that
/// is none. What came from another machine is added as it was written there.
std::string journal_line(const TrialResult& result);
TrialResult parse_journal_line(const std::string& line);

/// FNV-1a of a file's bytes, 64 bits: to notice that it has changed.
std::string content_hash(const std::string& bytes);

/// The study of a drive: contents of drive file and scene file, and what else changes results.
/// Perceptions and the number of trials do not: they may grow from one run to the next.
std::string trial_study(const Drive& drive, const std::string& scene_bytes, std::uint64_t seed);

/// trials.csv: `perception,zone,seed,speed_m_per_s,outcome,clearance_m,time_s`, of trials without
/// injected errors. Zones are their lower ends, m/s.
std::string trials_csv(const DriveTrials& trials, const std::vector<TrialResult>& results);
/// errors.csv: the same columns of the others, and `error_m`.
std::string errors_csv(const DriveTrials& trials, const std::vector<TrialResult>& results);

}  // namespace blindcorner
