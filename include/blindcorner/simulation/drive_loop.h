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
  std::optional<double> speed;           ///< m/s; empty: the drive file's
  std::shared_ptr<const Fitter> fitter;  ///< of the drive's scene, for the solver; null: its own
  bool keep_pictures = true;             ///< histograms and grids of the frames, for a page
  bool keep_last_map = false;   ///< the grid of the frame that last_map() finds, for statistics
  double injected_error = 0;    ///< m, of the misled oracles (perception.h)
  PerceptionNetworks networks;  ///< of perceptions that are networks
  /// Called before each sensor frame with the time of the drive, s. What it throws ends the drive.
  std::function<void(double time)> progress;
};

enum class DriveOutcome { reached, collision, stopped, timeout };
/// "reached", ... as files have it.
std::string outcome_word(DriveOutcome outcome);

/// Run times of one frame, ms: of the simulation (sense), and of what runs on a vehicle.
struct DriveTimes {
  double sense = 0;
  double perceive = 0;
  double map = 0;
  double plan = 0;
  double control = 0;  ///< all control steps until the next frame
};

/// What happened to a sensor frame.
enum class FrameFate {
  used,         ///< perception got it
  in_sight,     ///< hidden objects were in direct sight, which says more
  seen_before,  ///< they have been: what direct sight has shown is carried on by the map
  busy,         ///< it came while perception still worked on an earlier one
  missing       ///< it never arrived
};
std::string fate_word(FrameFate fate);

/// One sensor frame and what the vehicle knew and did at its time.
struct DriveFrame {
  double time = 0;  ///< s since the start
  VehicleState vehicle;
  Transform T_world_sensor = Transform::Identity();
  FrameFate fate = FrameFate::used;
  double arrival = 0;                    ///< s since the start; of a missing frame its own time
  std::optional<PoseMixture> mixture;    ///< the latest answer that the map knew at this time
  std::vector<PoseVelocity> velocities;  ///< [modes] of that answer; empty: it has none
  double mixture_age = 0;                ///< s since the capture that it is about
  std::vector<std::string> flags;        ///< of that answer
  std::string error;                     ///< of that answer
  std::optional<PoseVector> truth;       ///< of the hidden objects
  std::string plan_text;                 ///< what the replanner decided, and why
  std::vector<Eigen::Vector2d> path;     ///< m, the plan
  double target_speed = 0;               ///< m/s
  std::string braking_for;               ///< what it was braking for; empty: nothing
  double braking = 0;                    ///< m/s^2 asked for then
  double clearance = 0;                  ///< m, least since the frame before
  DriveTimes time_ms;
  std::optional<HistogramCube> counts, object_counts;  ///< as sensed; expected of the object
  std::vector<double> occupancy;  ///< [cells] probabilities; NaN where nothing is known
};

/// What the vehicle knows of hidden objects `ahead` seconds after a frame: its latest answer, moved
/// on as the map moves it; empty: it has none.
std::optional<PoseMixture> known_later(const Drive& drive, const DriveFrame& frame,
                                       double ahead = 0);

struct DriveResult {
  DriveOutcome outcome = DriveOutcome::timeout;
  std::string hit;       ///< name of what it collided with; empty: nothing
  double clearance = 0;  ///< m, least distance between vehicle and anything; 0: collision
  double length = 0;     ///< m driven
  double time = 0;       ///< s
  double wanted_speed = 0, mean_speed = 0, top_speed = 0, end_speed = 0;  ///< m/s
  std::vector<DriveFrame> frames;
  std::vector<Eigen::Vector3d> trace;  ///< x, y (m), yaw (rad) at every control step
  double trace_step = 0;               ///< s between them
};

/// The last frame that perception got with an answer in the map, as far as maps were kept; later
/// ones know by sight. Null: there is none.
const DriveFrame* last_map(const DriveResult& result);

/// Drives until goal, collision, standstill without a plan, or time limit. `sensor` is made from
/// the drive's scene with its light (with_light), once for many drives. The same seed gives the
/// same drive, run times excepted. Throws Error for an unknown perception.
DriveResult drive_through(const Drive& drive, const SimulatedSensor& sensor,
                          const DriveOptions& options);

}  // namespace blindcorner
