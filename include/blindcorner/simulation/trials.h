// SPDX-License-Identifier: Apache-2.0
/// Many drives, for statistics: which ones, run in parallel, and none of them twice.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "blindcorner/inverse/fit.h"
#include "blindcorner/io/drive_file.h"
#include "blindcorner/simulation/drive_loop.h"
#include "blindcorner/simulation/reliability_diagram.h"
#include "blindcorner/simulation/simulated_sensor.h"

namespace blindcorner {

/// One drive of a study.
struct Trial {
  std::string perception;
  int zone = 0;  ///< of the wanted speed, from 0
  std::uint64_t seed = 1;
  double speed = 0;  ///< m/s, a whole number of mm/s, so that files hold all of it
  double error = 0;  ///< m, injected (oracle_disc, oracle_covariance); a whole number of mm
  /// Probability of a collision that is taken at each decision; empty: the drive file's.
  std::optional<double> risk{};
};

/// Bins of what a trial's map said: a tenth of probability each.
inline constexpr int kMapBins = 10;

/// What became of it.
struct TrialResult {
  Trial trial;
  std::string outcome;   ///< outcome_word of drive_loop.h
  double clearance = 0;  ///< m, least
  double time = 0;       ///< s, simulated
  double length = 0;     ///< m driven
  double run_time = 0;   ///< s that it took to simulate
  /// m/s, while the vehicle was within DriveTrials::corner_radius of the corner; 0: it never was,
  /// or the study has no corner.
  double corner_speed = 0;
  /// Whether the next three were measured; journals of earlier versions have none of them.
  bool with_costs = false;
  bool present = false;        ///< whether there was a hidden object
  double impact_speed = 0;     ///< m/s, in a collision
  double hardest_braking = 0;  ///< m/s^2, asked for something that is no curve; 0: never
  /// What the map said of the cells of the hidden objects' search region, in the last frame before
  /// they came in sight; of those that it knew of by then.
  ReliabilityDiagram map{kMapBins};
  std::string program{};  ///< that has driven it (program_name.h); empty: it kept no record

  bool reached() const { return outcome == "reached"; }
};

struct TrialsOptions {
  int trials = 120;  ///< of each perception, spread evenly over the zones
  std::vector<std::string> perceptions{"los", "solver", "oracle"};
  std::uint64_t seed = 1;  ///< of the first trial; the next ones count on
  /// Trials with injected errors, of each of the two misled oracles, spread evenly over errors of
  /// 0-1, ..., 6-7 m, the published bins.
  int error_trials = 0;
  /// Risks that all perceptions are driven with beside the drive file's own, each from 0 to 1.
  std::vector<double> risks;
  int threads = 0;  ///< trials at a time; 0: one per processor

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Edges of the published bins of localisation error are whole metres up to this one.
inline constexpr int kErrorBins = 7;

/// Zone of a wanted speed, and its lower end, m/s.
double zone_lower(const DriveTrials& trials, int zone);

/// All trials of a study. Trial i has the same seed, speed and so world for every perception, and
/// does not depend on how many there are: a larger study holds the smaller one.
std::vector<Trial> plan_trials(const Drive& drive, const TrialsOptions& options);

/// What one trial drives with.
DriveOptions options_of(const Trial& trial);

/// Drives one trial. The same trial has the same result, run time excepted.
TrialResult run_trial(const Drive& drive, const SimulatedSensor& sensor, const Trial& trial,
                      const std::shared_ptr<const Fitter>& fitter = {},
                      const PerceptionNetworks& networks = {});

using TrialRun = std::function<TrialResult(const Trial&)>;
using TrialDone = std::function<void(const TrialResult&)>;

/// Mean speed over the part of a drive within a radius of a point, m/s; 0: it never came there.
double mean_speed_within(const DriveResult& result, const Eigen::Vector2d& point, double radius);

/// The trials of a plan that have no result yet.
std::vector<Trial> open_trials(const std::vector<Trial>& plan,
                               const std::vector<TrialResult>& finished);

/// Runs trials, `threads` at a time, and calls `done` for each as it ends, one call at a time. What
/// `run` or `done` throws ends the study and is thrown on.
void run_trials(const std::vector<Trial>& trials, int threads, const TrialRun& run,
                const TrialDone& done);

/// The drive as a trial drives it: with its risk, if it has one, for both what moves and what may
/// be hidden.
Drive drive_of(const Drive& drive, const Trial& trial);

/// What a trial is known by: its perception, with its risk if it has one, and its seed.
std::pair<std::string, std::uint64_t> trial_key(const Trial& trial);

/// Whether two are the same trial of the same perception.
bool same_trial(const Trial& a, const Trial& b);

/// The perceptions of some results, in the order of their first ones.
std::vector<std::string> perceptions_of(const std::vector<TrialResult>& results);

/// Sorted by perception (in their list's order), then by seed and error: the order of files.
void sort_trials(std::vector<TrialResult>& results);

}  // namespace blindcorner
