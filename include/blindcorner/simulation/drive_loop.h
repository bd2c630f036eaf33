// SPDX-License-Identifier: Apache-2.0
/// One simulated drive: sense, perceive, map, plan, act, until it ends.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/pose_mixture.h"
#include "blindcorner/inverse/fit.h"
#include "blindcorner/io/drive_file.h"
#include "blindcorner/planner/grid/hidden_motion.h"
#include "blindcorner/planner/vehicles/vehicle_state.h"
#include "blindcorner/simulation/perception_networks.h"
#include "blindcorner/simulation/simulated_sensor.h"

namespace blindcorner {

struct DriveOptions {
  std::string perception = "solver";
  std::uint64_t seed = 1;
  std::optional<double> speed;           ///< m/s; empty: the drive file's speed
  std::shared_ptr<const Fitter> fitter;  ///< solver's fitter for the drive's scene; null: a new one
  bool keep_pictures = true;             ///< keeps histograms and grids of the frames, for a page
  bool keep_last_map = false;            ///< keeps the grid of last_map()'s frame, for statistics
  /// Answers take as long as they take on this machine, and frames that come meanwhile are passed
  /// over. Only the first frame, which starts perception up, has the declared delay. The same seed
  /// then gives another drive each time.
  bool real_time = false;
  double injected_error = 0;             ///< m, error of the misled oracles (perception.h)
  PerceptionNetworks networks;           ///< networks of the perceptions that need one
  /// Called before each sensor frame with the time of the drive, s. An exception from it ends the
  /// drive.
  std::function<void(double time)> progress;
};

enum class DriveOutcome { reached, collision, stopped, timeout };
/// The outcome's word in files: "reached", ...
std::string outcome_word(DriveOutcome outcome);

/// Run times of one frame, ms: of the simulation (sense), and of the parts that run on a vehicle.
struct DriveTimes {
  double sense = 0;
  double perceive = 0;
  double map = 0;
  double plan = 0;
  double control = 0;  ///< all control steps until the next frame
};

/// What happened to a sensor frame.
enum class FrameFate {
  used,         ///< perception got the frame
  in_sight,     ///< hidden objects were in direct sight, which says more
  seen_before,  ///< hidden objects were in direct sight before; the map carries them on
  busy,         ///< perception was still working on an earlier frame
  missing       ///< the frame never arrived
};
std::string fate_word(FrameFate fate);

/// One sensor frame, and what the vehicle knew and did at this time.
struct DriveFrame {
  double time = 0;  ///< s since the start
  VehicleState vehicle;
  Transform T_world_sensor = Transform::Identity();
  FrameFate fate = FrameFate::used;
  double arrival = 0;                    ///< s since the start; for a missing frame, its own time
  std::optional<PoseMixture> mixture;    ///< the latest answer that the map knew at this time
  std::vector<PoseVelocity> velocities;  ///< [modes] velocities of that answer; empty: none
  double mixture_age = 0;                ///< s since the capture that the answer is about
  std::vector<std::string> flags;        ///< flags of that answer
  std::string error;                     ///< error of that answer
  std::optional<PoseVector> truth;       ///< true pose of the hidden objects
  std::string plan_text;                 ///< what the replanner decided, and why
  std::vector<Eigen::Vector2d> path;     ///< m, the planned path
  double target_speed = 0;               ///< m/s
  std::string braking_for;               ///< what the vehicle was braking for; empty: nothing
  double braking = 0;                    ///< m/s^2, deceleration asked for then
  double clearance = 0;                  ///< m, least clearance since the previous frame
  DriveTimes time_ms;
  std::optional<HistogramCube> counts, object_counts;  ///< sensed; expected counts of the object
  std::vector<double> occupancy;  ///< [cells] probabilities; NaN where nothing is known
};

/// The vehicle's knowledge of hidden objects `ahead` seconds after a frame: its latest answer,
/// moved on as the map moves it. Empty: there is no answer.
std::optional<PoseMixture> known_later(const Drive& drive, const DriveFrame& frame,
                                       double ahead = 0);

struct DriveResult {
  DriveOutcome outcome = DriveOutcome::timeout;
  std::string hit;       ///< name of what the vehicle collided with; empty: nothing
  double clearance = 0;  ///< m, least distance between vehicle and anything; 0: collision
  double length = 0;     ///< m driven
  double time = 0;       ///< s
  double wanted_speed = 0, mean_speed = 0, top_speed = 0, end_speed = 0;  ///< m/s
  std::vector<DriveFrame> frames;
  std::vector<Eigen::Vector3d> trace;  ///< x, y (m), yaw (rad) at every control step
  double trace_step = 0;               ///< s between points of the trace
};

/// The last frame that perception got while the map had an answer, as far as maps were kept. Later
/// frames know hidden objects by direct sight. Null: there is no such frame.
const DriveFrame* last_map(const DriveResult& result);

/// Drives until goal, collision, standstill (without a plan, or before something that the vehicle
/// would touch), or time limit. `sensor` is made from the drive's scene with its light
/// (with_light), once for many drives. The same seed gives the same drive, except for run times.
/// Throws Error for an unknown perception.
DriveResult drive_through(const Drive& drive, const SimulatedSensor& sensor,
                          const DriveOptions& options);

}  // namespace blindcorner
