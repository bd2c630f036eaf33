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

/// Kind of vehicle.
enum class VehicleKind { car, robot };

/// How the speed is chosen. `wanted`: the wanted speed wherever curves and the plan allow it.
/// `safe`: also such that the vehicle can stop before anything that may be there
/// (planner/control/safe_speed.h).
enum class SpeedMode { wanted, safe };

/// Which controller steers: this project's planner and follower, or the published pipeline
/// (planner/control/published_controller.h), which treats every obstacle as the published disc.
enum class DriveController { own, published };

/// Body and start of the vehicle. Its reference point is the middle of the body.
struct DriveVehicle {
  VehicleKind kind = VehicleKind::car;
  double length = 4.5;                              ///< m
  double width = 1.8;                               ///< m
  double height = 1.5;                              ///< m: the vehicle drives under anything higher
  Eigen::Vector2d start = Eigen::Vector2d::Zero();  ///< m, world
  double start_yaw = 0;                             ///< rad
  double turning_radius = 5.5;  ///< m, smallest of a plan; 0: the vehicle can turn on the spot
  std::optional<double> start_speed;  ///< m/s; empty: the wanted speed
  /// Whether the vehicle lowers its speed to what friction allows in curves, or holds the wanted
  /// speed.
  bool brakes_for_curves = true;
  /// Share of the friction limit (mu g) that the curves of a plan may need at the wanted speed;
  /// empty: plans ignore it.
  std::optional<double> cornering_share;
  double friction = 0.9;  ///< mu, between tyres and road
  /// Standard deviations of the vehicle's error of localization. The error is an offset that stays
  /// constant for a whole drive, since a map and odometry drift more slowly than a corner is taken.
  double localization_sigma = 0;      ///< m, of x and of y
  double localization_yaw_sigma = 0;  ///< rad
};

/// The histogram sensor on the vehicle, and the faults of its frames.
struct DriveSensor {
  Transform T_vehicle_sensor = Transform::Identity();
  double rate = 10;    ///< frames per second
  double light = 1;    ///< factor on the laser's light; daylight stays the same
  double ambient = 1;  ///< factor on the background light: sunlight, direct and scattered by fog
  double missing_share = 0;  ///< probability that a frame never arrives
  double late_share = 0;     ///< probability that a frame arrives late
  double late_by = 0;        ///< s, delay of a late frame
};

/// Direct sight of the vehicle: horizontal rays about the sensor's axis, at several heights.
struct DirectSight {
  double field_of_view = 0.8;  ///< rad, horizontal, full angle
  double range = 100;          ///< m
};

/// One component of the true hidden object: drawn uniformly from an interval, or stated if both
/// ends are the same.
struct TrueComponent {
  double lower = 0;  ///< m, rad or 1
  double upper = 0;  ///< m, rad or 1
};

/// Where and when the vehicle and the hidden object meet if neither reacts.
struct DriveMeeting {
  Eigen::Vector2d point = Eigen::Vector2d::Zero();  ///< m, on the vehicle's line straight ahead
  double time = 0;                                  ///< s after the start
  double spread = 0;  ///< m, standard deviation along the object's way
};

/// Change of the hidden objects' motion: they stop, turn or turn back.
struct DriveTurn {
  double time = 0;                        ///< s after the start
  std::vector<Eigen::Vector2d> velocity;  ///< [objects] m/s, from then on
};

/// The truth, which the vehicle does not know.
struct DriveTruth {
  double present = 1;  ///< probability that there is a hidden object at all
  /// [unknowns] of the scene; drawn from the scene's prior where empty.
  std::vector<std::optional<TrueComponent>> components;
  /// [objects] m/s. Moving objects keep moving, also out of their search region.
  std::vector<Eigen::Vector2d> velocity;
  /// [objects] m/s; velocities are drawn uniformly between `velocity` and these. Empty: they are
  /// stated.
  std::vector<Eigen::Vector2d> velocity_upper;
  /// Meeting of the vehicle with the first object: each starts as far from the meeting point as it
  /// moves until the meeting.
  std::optional<DriveMeeting> meeting;
  std::optional<DriveTurn> turn;
};

/// Wanted speeds that `blindcorner trials` varies, in zones of equal width.
struct DriveTrials {
  double speed_lower = 0, speed_upper = 0;  ///< m/s
  int zones = 1;
  /// The mean speed is measured while the vehicle is within this distance of the corner, m; 0: not
  /// measured.
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
  /// Points on the way, m, world; the last one is the goal if there is no finish line.
  std::vector<Eigen::Vector2d> route;
  double goal_tolerance = 1;  ///< m, of points
  /// Ends of a line across the lane, m: after the points, the vehicle reaches the goal when it
  /// crosses this line.
  std::optional<std::array<Eigen::Vector2d, 2>> finish_line;
  double speed_lower = 5;  ///< m/s, wanted: drawn uniformly; stated if both are the same
  double speed_upper = 5;  ///< m/s
  double time_limit = 60;  ///< s
  DriveController controller = DriveController::own;
  SpeedMode speed_mode = SpeedMode::wanted;
  double risk = 0.005;         ///< of a collision, at each decision in SpeedMode::safe
  double traffic_risk = 0.02;  ///< of touching a moving object, at each decision
  /// Largest speed at which an object out of sight may come towards the vehicle, m/s, in
  /// SpeedMode::safe.
  double closing_speed = 0;
  DriveSensor sensor;
  DirectSight sight;
  GridGeometry map;
  /// The vehicle's plans stay in this rectangle, m; empty: anywhere on the map.
  std::optional<Eigen::AlignedBox2d> lane;
  DriveTruth truth;
  std::string perception = "solver";
  std::map<std::string, double> delay;         ///< s, by perception
  std::map<std::string, std::string> weights;  ///< paths of weight files, by perception
  DriveTrials trials;  ///< one zone from `speed_lower` to `speed_upper`, unless stated
};

/// Reads a drive file and the scene that it names. Throws Error with one line: file, field path,
/// found value, accepted values. Unknown fields are errors.
Drive read_drive(const std::string& path);

/// The same from the text of a drive file. Messages name `path`, and the scene is looked for beside
/// it.
Drive parse_drive_text(const std::string& text, const std::string& path);

}  // namespace blindcorner
