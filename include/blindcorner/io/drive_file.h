// SPDX-License-Identifier: Apache-2.0
/// Drive files: JSON, documented field by field in docs/drive.md.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/motion.h"
#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/planner/grid/grid_geometry.h"

namespace blindcorner {

/// What drives.
enum class VehicleKind { car, robot };

/// How the speed is chosen: the wanted one wherever curves and the plan allow it, or also such that
/// the vehicle can stop before what may be there (planner/control/safe_speed.h).
enum class SpeedMode { wanted, safe };

/// Who steers: this project's planner and follower, or the published pipeline
/// (planner/control/published_controller.h) with every obstacle as the published disc.
enum class DriveController { own, published };

/// Body of the vehicle and where it starts. Its reference point is the middle of the body.
struct DriveVehicle {
  VehicleKind kind = VehicleKind::car;
  double length = 4.5;                              ///< m
  double width = 1.8;                               ///< m
  double height = 1.5;                              ///< m: what is higher is driven under
  Eigen::Vector2d start = Eigen::Vector2d::Zero();  ///< m, world
  double start_yaw = 0;                             ///< rad
  double turning_radius = 5.5;        ///< m, tightest of a plan; 0: it can turn on the spot
  std::optional<double> start_speed;  ///< m/s; empty: the wanted speed
  /// Whether the speed is lowered to what friction holds in curves, or held at the wanted one.
  bool brakes_for_curves = true;
  /// Share of the friction limit (mu g) that the curves of a plan may need at the wanted speed;
  /// empty: plans do not look at it.
  std::optional<double> cornering_share;
  double friction = 0.9;  ///< mu, between tyres and road
  /// Standard deviations of where the vehicle takes itself to be: an offset that stays the same for
  /// a whole drive, since a map and odometry drift slower than a corner is taken.
  double localization_sigma = 0;      ///< m, of x and of y
  double localization_yaw_sigma = 0;  ///< rad
};

/// The histogram sensor on the vehicle, and what may go wrong with its frames.
struct DriveSensor {
  Transform T_vehicle_sensor = Transform::Identity();
  double rate = 10;          ///< frames per second
  double light = 1;          ///< factor on the laser's light; daylight stays
  double ambient = 1;        ///< factor on the background light: sun, and what fog scatters of it
  double missing_share = 0;  ///< probability that a frame never arrives
  double late_share = 0;     ///< probability that a frame arrives late
  double late_by = 0;        ///< s, by which it then is late
};

/// What the vehicle sees directly: a plane of rays about the sensor's axis.
struct DirectSight {
  double field_of_view = 0.8;  ///< rad, horizontal, full angle
  double range = 100;          ///< m
};

/// One component of the true hidden object: drawn uniformly from an interval; stated where both
/// ends are the same.
struct TrueComponent {
  double lower = 0;  ///< m, rad or 1
  double upper = 0;  ///< m, rad or 1
};

/// Where and when vehicle and hidden object meet if nobody acts.
struct DriveMeeting {
  Eigen::Vector2d point = Eigen::Vector2d::Zero();  ///< m, on the vehicle's way straight on
  double time = 0;                                  ///< s after the start
  double spread = 0;  ///< m, standard deviation along the object's way
};

/// Hidden objects that stop, turn or turn back.
struct DriveTurn {
  double time = 0;                        ///< s after the start
  std::vector<Eigen::Vector2d> velocity;  ///< [objects] m/s, from then on
};

/// The truth that the vehicle does not know.
struct DriveTruth {
  double present = 1;  ///< probability that there is a hidden object at all
  /// [unknowns] of the scene; empty: drawn from the scene's prior.
  std::vector<std::optional<TrueComponent>> components;
  /// [objects] m/s. What moves goes on moving, out of its search region too.
  std::vector<Eigen::Vector2d> velocity;
  /// [objects] m/s; velocities are drawn uniformly up to these. Empty: they are stated.
  std::vector<Eigen::Vector2d> velocity_upper;
  /// Of the first object: it and the vehicle start as far from there as they go until then.
  std::optional<DriveMeeting> meeting;
  std::optional<DriveTurn> turn;
};

/// What `blindcorner trials` varies: wanted speeds, in zones of equal width.
struct DriveTrials {
  double speed_lower = 0, speed_upper = 0;  ///< m/s
  int zones = 1;
  /// Mean speed is measured while the vehicle is this near to the corner, m; 0: not measured.
  double corner_radius = 0;
  Eigen::Vector2d corner = Eigen::Vector2d::Zero();  ///< m
};

/// A drive: everything that `blindcorner drive` needs to know.
struct Drive {
  std::string name;
  std::string path;  ///< of the file, for messages
  Scene scene;
  Motion motion;  ///< of the hidden object as the tracker assumes it
  DriveVehicle vehicle;
  /// Points on the way, m, world; the last one is the goal where there is no finish line.
  std::vector<Eigen::Vector2d> route;
  double goal_tolerance = 1;  ///< m, of points
  /// Ends of a line across the lane, m: after the points the goal is reached when the vehicle
  /// passes it.
  std::optional<std::array<Eigen::Vector2d, 2>> finish_line;
  double speed_lower =
      5;  ///< m/s, wanted speed: drawn uniformly, or stated where both are the same
  double speed_upper = 5;  ///< m/s
  double time_limit = 60;  ///< s
  DriveController controller = DriveController::own;
  SpeedMode speed_mode = SpeedMode::wanted;
  double risk = 0.005;         ///< of a collision at each decision of SpeedMode::safe
  double traffic_risk = 0.02;  ///< of touching what moves, at each decision
  /// m/s with which what is not in sight may come towards the vehicle, in SpeedMode::safe.
  double closing_speed = 0;
  DriveSensor sensor;
  DirectSight sight;
  GridGeometry map;
  /// Plans of the vehicle stay in this rectangle, m; empty: anywhere on the map.
  std::optional<Eigen::AlignedBox2d> lane;
  DriveTruth truth;
  std::string perception = "solver";
  std::map<std::string, double> delay;         ///< s, by perception
  std::map<std::string, std::string> weights;  ///< paths of files of weights, by perception
  DriveTrials trials;                          ///< in one zone of `speed`, unless stated
};

/// Reads a drive file and the scene that it names. Throws Error with one line: file, field path,
/// what was found, what is accepted. Unknown fields are errors.
Drive read_drive(const std::string& path);

/// The same from a drive file's text; `path` stands for it in messages, and the scene is looked for
/// beside it.
Drive parse_drive_text(const std::string& text, const std::string& path);

}  // namespace blindcorner
