// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/trials.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <mutex>
#include <random>
#include <set>
#include <thread>
#include <tuple>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/program_name.h"
#include "blindcorner/simulation/drive_loop.h"
#include "blindcorner/simulation/perception.h"
#include "blindcorner/simulation/true_world.h"
#include "simulation/convex_distance.h"

namespace blindcorner {
namespace {

/// Speeds and errors come from another random sequence than the world's random values.
constexpr std::uint64_t kSpeedSeed = 0xa0761d6478bd642f;
/// Seeds of trials with injected errors begin this far from the others.
constexpr std::uint64_t kErrorSeeds = 1'000'000;
/// Tolerance for rounding, m: a body that only touches a cell's border is not in the cell.
constexpr double kTouches = 1e-9;

double drawn(std::mt19937_64& random, double lower, double upper) {
  const double value =
      lower < upper ? std::uniform_real_distribution<double>(lower, upper)(random) : lower;
  return std::round(value * 1000) / 1000;
}

Trial drawn_trial(const DriveTrials& trials, int number, std::uint64_t seed) {
  Trial trial;
  trial.zone = number % trials.zones;
  trial.seed = seed + static_cast<std::uint64_t>(number);
  std::mt19937_64 random(trial.seed ^ kSpeedSeed);
  trial.speed = drawn(random, zone_lower(trials, trial.zone), zone_lower(trials, trial.zone + 1));
  return trial;
}

/// Whether a point (m) lies in the x and y intervals that the scene allows for any hidden object.
bool in_search_region(const Scene& scene, const Eigen::Vector2d& at) {
  for (int object = 0; object < object_count(scene); ++object) {
    bool inside = true;
    for (const Unknown& unknown : scene.unknowns) {
      const auto axis = static_cast<Eigen::Index>(unknown.component);
      if (unknown.object != object || axis > 1) continue;
      inside = inside && at[axis] >= unknown.lower && at[axis] <= unknown.upper;
    }
    if (inside) return true;
  }
  return false;
}

/// Whether a body reaches into a cell. The map's probability is that of this event.
bool occupied(const std::vector<Polygon>& bodies, const Eigen::Vector2d& center, double size) {
  const double half = size / 2 - kTouches;
  const Polygon cell{center + Eigen::Vector2d(-half, -half), center + Eigen::Vector2d(half, -half),
                     center + Eigen::Vector2d(half, half), center + Eigen::Vector2d(-half, half)};
  return std::ranges::any_of(bodies,
                             [&](const Polygon& body) { return convex_distance(cell, body) <= 0; });
}

/// Statements of the last map before the hidden objects came in sight.
ReliabilityDiagram map_statements(const Drive& drive, std::uint64_t seed,
                                  const DriveResult& result) {
  ReliabilityDiagram map(kMapBins);
  const DriveFrame* last = last_map(result);
  if (last == nullptr) return map;
  const std::vector<Polygon> bodies = TrueWorld(drive, seed).bodies(last->time);
  for (std::size_t i = 0; i < drive.map.cells(); ++i) {
    const Eigen::Vector2d at = drive.map.center(drive.map.cell(i));
    const double probability = last->occupancy[i];
    if (std::isnan(probability) || !in_search_region(drive.scene, at)) continue;
    map.add(probability, occupied(bodies, at, drive.map.cell_size));
  }
  return map;
}

/// The decision risk that the drive file names.
double own_risk(const Drive& drive) {
  return drive.speed_mode == SpeedMode::safe ? drive.risk : drive.traffic_risk;
}

/// Hardest braking for anything but a curve, m/s^2.
double hardest_braking(const DriveResult& result) {
  double hardest = 0;
  for (const DriveFrame& frame : result.frames) {
    if (frame.braking_for.find("curve") == std::string::npos) {
      hardest = std::max(hardest, frame.braking);
    }
  }
  return hardest;
}

/// Position in the list of perceptions.
std::ptrdiff_t rank(const std::string& perception) {
  static const std::vector<std::string> names = perception_names();
  return std::ranges::find(names, perception) - names.begin();
}

}  // namespace

void TrialsOptions::validate() const {
  if (trials < 1) throw Error("TrialsOptions.trials", "accepted: a number > 0");
  if (perceptions.empty()) throw Error("TrialsOptions.perceptions", "accepted: at least one");
  if (error_trials < 0) throw Error("TrialsOptions.error_trials", "accepted: a number >= 0");
  for (const double risk : risks) {
    if (!(risk >= 0 && risk <= 1)) throw Error("TrialsOptions.risks", "accepted: 0 to 1");
  }
  if (threads < 0) throw Error("TrialsOptions.threads", "accepted: a number >= 0");
}

double zone_lower(const DriveTrials& trials, int zone) {
  return trials.speed_lower + (trials.speed_upper - trials.speed_lower) * zone / trials.zones;
}

std::vector<Trial> plan_trials(const Drive& drive, const TrialsOptions& options) {
  options.validate();
  std::vector<Trial> plan;
  for (int i = 0; i < options.trials; ++i) {
    Trial trial = drawn_trial(drive.trials, i, options.seed);
    for (const std::string& name : options.perceptions) {
      trial.perception = name;
      trial.risk.reset();
      plan.push_back(trial);
      for (const double risk : options.risks) {
        if (risk == own_risk(drive)) continue;
        trial.risk = risk;
        plan.push_back(trial);
      }
    }
  }
  for (int i = 0; i < options.error_trials; ++i) {
    // A bin's trials go through all speed zones, so that errors and speeds are not confounded.
    const int bin = i % kErrorBins;
    Trial trial = drawn_trial(drive.trials, i / kErrorBins, options.seed);
    trial.seed = options.seed + kErrorSeeds + static_cast<std::uint64_t>(i);
    std::mt19937_64 random(trial.seed ^ kSpeedSeed);
    trial.speed = drawn(random, zone_lower(drive.trials, trial.zone),
                        zone_lower(drive.trials, trial.zone + 1));
    trial.error = drawn(random, bin, bin + 1);
    for (const char* name : {"oracle_disc", "oracle_covariance"}) {
      trial.perception = name;
      plan.push_back(trial);
    }
  }
  return plan;
}

DriveOptions options_of(const Trial& trial) {
  DriveOptions options;
  options.perception = trial.perception;
  options.seed = trial.seed;
  options.speed = trial.speed;
  options.injected_error = trial.error;
  return options;
}

TrialResult run_trial(const Drive& drive, const SimulatedSensor& sensor, const Trial& trial,
                      const std::shared_ptr<const Fitter>& fitter,
                      const PerceptionNetworks& networks) {
  const auto start = std::chrono::steady_clock::now();
  DriveOptions options = options_of(trial);
  options.fitter = fitter;
  options.networks = networks;
  options.keep_pictures = false;
  options.keep_last_map = true;
  const DriveResult driven = drive_through(drive_of(drive, trial), sensor, options);
  TrialResult result;
  result.trial = trial;
  result.outcome = outcome_word(driven.outcome);
  result.clearance = driven.clearance;
  result.time = driven.time;
  result.length = driven.length;
  result.with_costs = true;
  result.present = !driven.frames.empty() && driven.frames.front().truth.has_value();
  if (driven.outcome == DriveOutcome::collision) result.impact_speed = driven.end_speed;
  result.hardest_braking = hardest_braking(driven);
  result.map = map_statements(drive, trial.seed, driven);
  result.corner_speed = mean_speed_within(driven, drive.trials.corner, drive.trials.corner_radius);
  result.program = program_name();
  result.run_time = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

double mean_speed_within(const DriveResult& result, const Eigen::Vector2d& point, double radius) {
  double length = 0, time = 0;
  for (std::size_t i = 0; i + 1 < result.trace.size(); ++i) {
    const Eigen::Vector2d from = result.trace[i].head<2>(), to = result.trace[i + 1].head<2>();
    if ((from - point).norm() > radius || (to - point).norm() > radius) continue;
    length += (to - from).norm();
    time += result.trace_step;
  }
  return time > 0 ? length / time : 0;
}

std::vector<Trial> open_trials(const std::vector<Trial>& plan,
                               const std::vector<TrialResult>& finished) {
  std::set<std::pair<std::string, std::uint64_t>> known;
  for (const TrialResult& result : finished) known.insert(trial_key(result.trial));
  std::vector<Trial> open;
  std::ranges::copy_if(plan, std::back_inserter(open),
                       [&](const Trial& trial) { return !known.contains(trial_key(trial)); });
  return open;
}

void run_trials(const std::vector<Trial>& trials, int threads, const TrialRun& run,
                const TrialDone& done) {
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::exception_ptr failure;
  const auto work = [&] {
    // Each thread runs a drive by itself: two drives side by side waste less than one on two cores.
    tbb::task_arena arena(1);
    for (std::size_t i = next++; i < trials.size(); i = next++) {
      try {
        const TrialResult result = arena.execute([&] { return run(trials[i]); });
        const std::lock_guard lock(mutex);
        if (!failure) done(result);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (!failure) failure = std::current_exception();
        next = trials.size();
      }
    }
  };
  const std::size_t wanted = threads > 0
                                 ? static_cast<std::size_t>(threads)
                                 : std::max<std::size_t>(1, std::thread::hardware_concurrency());
  {
    std::vector<std::jthread> workers;
    for (std::size_t i = 1; i < std::min(wanted, trials.size()); ++i) workers.emplace_back(work);
    work();
  }
  if (failure) std::rethrow_exception(failure);
}

Drive drive_of(const Drive& drive, const Trial& trial) {
  Drive driven = drive;
  if (trial.risk) driven.risk = driven.traffic_risk = *trial.risk;
  return driven;
}

std::pair<std::string, std::uint64_t> trial_key(const Trial& trial) {
  return {trial.perception + (trial.risk ? "@" + std::to_string(*trial.risk) : std::string()),
          trial.seed};
}

std::vector<std::string> perceptions_of(const std::vector<TrialResult>& results) {
  std::vector<std::string> names;
  for (const TrialResult& result : results) {
    if (std::ranges::find(names, result.trial.perception) == names.end()) {
      names.push_back(result.trial.perception);
    }
  }
  return names;
}

void sort_trials(std::vector<TrialResult>& results) {
  std::ranges::sort(results, [](const TrialResult& a, const TrialResult& b) {
    return std::tuple(rank(a.trial.perception), a.trial.seed, a.trial.risk) <
           std::tuple(rank(b.trial.perception), b.trial.seed, b.trial.risk);
  });
}

}  // namespace blindcorner
