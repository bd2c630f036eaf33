// SPDX-License-Identifier: Apache-2.0
/// Many drives for statistics: the plan of the drives, and their parallel run. No drive runs twice.
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
  int zone = 0;  ///< zone of the wanted speed, from 0
  std::uint64_t seed = 1;
  double speed = 0;  ///< m/s, a whole number of mm/s, so that files hold it exactly
  double error = 0;  ///< m, injected error (oracle_disc, oracle_covariance); a whole number of mm
  /// Accepted probability of a collision at each decision; empty: the drive file's.
  std::optional<double> risk{};
};

/// Bins of the probabilities in a trial's map. Each bin is a tenth wide.
inline constexpr int kMapBins = 10;

/// Result of a trial.
struct TrialResult {
  Trial trial;
  std::string outcome;   ///< outcome_word of drive_loop.h
  double clearance = 0;  ///< m, least clearance
  double time = 0;       ///< s, simulated
  double length = 0;     ///< m driven
  double run_time = 0;   ///< s, run time of the simulation
  /// Mean speed, m/s, while the vehicle was within DriveTrials::corner_radius of the corner. 0: it
  /// never was, or the study has no corner.
  double corner_speed = 0;
  /// Whether the next three values were measured. Journals of earlier versions have none of them.
  bool with_costs = false;
  bool present = false;        ///< whether there was a hidden object
  double impact_speed = 0;     ///< m/s, in a collision
  double hardest_braking = 0;  ///< m/s^2, asked for a reason that names no curve; 0: never
  /// Probabilities of the map for the cells of the hidden objects' search region, in the last frame
  /// before the objects came in sight. Only cells that the map knew by then count.
  ReliabilityDiagram map{kMapBins};
  std::string program{};  ///< program that drove the trial (program_name.h); empty: not recorded

  bool reached() const { return outcome == "reached"; }
};

struct TrialsOptions {
  int trials = 120;  ///< trials of each perception, spread evenly over the zones
  std::vector<std::string> perceptions{"los", "solver", "oracle"};
  std::uint64_t seed = 1;  ///< seed of the first trial; the next trials count on
  /// Trials with injected errors, for each of the two misled oracles. They are spread evenly over
  /// errors of 0-1, ..., 6-7 m, the published bins.
  int error_trials = 0;
  /// Further risks with which all perceptions are driven, beside the drive file's own, each from 0
  /// to 1.
  std::vector<double> risks;
  int threads = 0;  ///< trials at a time; 0: one per processor

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// The edges of the published bins of localisation error are whole metres up to this number.
inline constexpr int kErrorBins = 7;

/// Lower end of a zone of the wanted speed, m/s.
double zone_lower(const DriveTrials& trials, int zone);

/// All trials of a study. Trial i has the same seed and speed, and so the same world, for every
/// perception. Trial i does not depend on the number of trials: a larger study holds the smaller
/// one.
std::vector<Trial> plan_trials(const Drive& drive, const TrialsOptions& options);

/// Drive options of a trial.
DriveOptions options_of(const Trial& trial);

/// Drives one trial. The same trial has the same result, except for run time.
TrialResult run_trial(const Drive& drive, const SimulatedSensor& sensor, const Trial& trial,
                      const std::shared_ptr<const Fitter>& fitter = {},
                      const PerceptionNetworks& networks = {});

using TrialRun = std::function<TrialResult(const Trial&)>;
using TrialDone = std::function<void(const TrialResult&)>;

/// Mean speed over the part of a drive within a radius of a point, m/s; 0: the vehicle never came
/// there.
double mean_speed_within(const DriveResult& result, const Eigen::Vector2d& point, double radius);

/// The trials of a plan that have no result yet.
std::vector<Trial> open_trials(const std::vector<Trial>& plan,
                               const std::vector<TrialResult>& finished);

/// Runs `threads` trials at a time. Calls `done` for each trial as it ends, one call at a time. An
/// exception from `run` or `done` ends the study and is thrown on.
void run_trials(const std::vector<Trial>& trials, int threads, const TrialRun& run,
                const TrialDone& done);

/// The drive as a trial drives it. The trial's risk, if it has one, holds both for moving objects
/// and for objects that may be hidden.
Drive drive_of(const Drive& drive, const Trial& trial);

/// The key of a trial: its perception, with its risk if it has one, and its seed.
std::pair<std::string, std::uint64_t> trial_key(const Trial& trial);

/// The perceptions of some results, in the order of their first results.
std::vector<std::string> perceptions_of(const std::vector<TrialResult>& results);

/// Sorts by perception (in the order of perception_names()), then by seed and risk: the order of
/// files.
void sort_trials(std::vector<TrialResult>& results);

}  // namespace blindcorner
