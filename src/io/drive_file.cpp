// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/drive_file.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <tuple>
#include <variant>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/orientation.h"
#include "blindcorner/io/scene_file.h"
#include "io/file_bytes.h"
#include "io/file_kind.h"
#include "io/json_reader.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;
using Json = JsonReader::Json;

/// Limits that catch slips of the pen, like those of scene files.
const NumberRange kPosition = NumberRange::between(-1e5, 1e5);
const NumberRange kAnyAngle = NumberRange::between(-3600, 3600);
const NumberRange kShare = NumberRange::between(0, 1);
/// A vehicle is at least as large as a toy, and goes at most as fast as a train.
const NumberRange kVehicleLength = NumberRange::between(0.01, 50);
const NumberRange kSpeed{.lower = 0, .upper = 100, .above_lower = true};
const NumberRange kDelay = NumberRange::between(0, 60);
const NumberRange kLightFactor{.lower = 0, .upper = 1e6, .above_lower = true};
/// Most cells of a map: 4 million are 2000 x 2000, for which planning takes seconds.
constexpr double kMaxCells = 4e6;

Vector2d read_point(const JsonReader& reader) {
  const auto parts = reader.elements_exactly(2, "numbers");
  return {parts[0].number(kPosition), parts[1].number(kPosition)};
}

/// A number, or [lower, upper] from which one is drawn.
std::pair<double, double> read_stated_or_drawn(const JsonReader& reader, const NumberRange& range) {
  if (reader.is_array()) return reader.interval(range);
  const double value = reader.number(range);
  return {value, value};
}

void read_localization(const JsonReader& reader, DriveVehicle& vehicle) {
  if (!reader.present()) return;
  reader.allow_only({"sigma_m", "sigma_deg"});
  vehicle.localization_sigma = reader.at("sigma_m").number_or(0, NumberRange::between(0, 100));
  vehicle.localization_yaw_sigma =
      reader.at("sigma_deg").number_or(0, NumberRange::between(0, 90)) * kDegree;
}

DriveVehicle read_vehicle(const JsonReader& reader) {
  reader.allow_only({"kind", "length_m", "width_m", "height_m", "turning_radius_m", "start",
                     "brakes_for_curves", "cornering_share", "mu", "localization"});
  DriveVehicle vehicle;
  if (reader.at("kind").word({"car", "robot"}) == "robot") {
    vehicle.kind = VehicleKind::robot;
    vehicle.length = 0.2, vehicle.width = 0.2, vehicle.height = 0.3, vehicle.turning_radius = 0;
  }
  vehicle.length = reader.at("length_m").number_or(vehicle.length, kVehicleLength);
  vehicle.width = reader.at("width_m").number_or(vehicle.width, kVehicleLength);
  vehicle.height = reader.at("height_m").number_or(vehicle.height, kVehicleLength);
  vehicle.turning_radius =
      reader.at("turning_radius_m").number_or(vehicle.turning_radius, NumberRange::between(0, 1e3));
  vehicle.brakes_for_curves = reader.at("brakes_for_curves").boolean_or(true);
  if (const JsonReader share = reader.at("cornering_share"); share.present()) {
    vehicle.cornering_share =
        share.number(NumberRange{.lower = 0, .upper = 1, .above_lower = true});
  }
  vehicle.friction = reader.at("mu").number_or(vehicle.friction, NumberRange::between(0.05, 1.5));
  read_localization(reader.at("localization"), vehicle);
  const JsonReader start = reader.at("start");
  start.allow_only({"position_m", "yaw_deg", "speed_m_per_s"});
  vehicle.start = read_point(start.at("position_m"));
  vehicle.start_yaw = start.at("yaw_deg").number_or(0, kAnyAngle) * kDegree;
  if (const JsonReader speed = start.at("speed_m_per_s"); speed.present()) {
    vehicle.start_speed = speed.number(NumberRange::between(0, 100));
  }
  return vehicle;
}

void read_frame_faults(const JsonReader& reader, DriveSensor& sensor) {
  if (!reader.present()) return;
  reader.allow_only({"missing_share", "late_share", "late_by_s"});
  sensor.missing_share = reader.at("missing_share").number_or(0, kShare);
  sensor.late_share = reader.at("late_share").number_or(0, kShare);
  sensor.late_by = sensor.late_share > 0 ? reader.at("late_by_s").number(kDelay)
                                         : reader.at("late_by_s").number_or(0, kDelay);
}

DriveSensor read_drive_sensor(const JsonReader& reader) {
  reader.allow_only({"mount", "rate_hz", "light", "ambient", "faults"});
  DriveSensor sensor;
  const JsonReader mount = reader.at("mount");
  mount.allow_only({"position_m", "yaw_pitch_roll_deg"});
  sensor.T_vehicle_sensor.translation() = mount.at("position_m").vector(kPosition);
  if (const JsonReader angles = mount.at("yaw_pitch_roll_deg"); angles.present()) {
    sensor.T_vehicle_sensor.linear() = rotation_of(angles.vector(kAnyAngle) * kDegree);
  }
  sensor.rate = reader.at("rate_hz").number(NumberRange::between(0.1, 1000));
  sensor.light = reader.at("light").number_or(1, kLightFactor);
  sensor.ambient = reader.at("ambient").number_or(1, kLightFactor);
  read_frame_faults(reader.at("faults"), sensor);
  return sensor;
}

/// Horizontal angle that all zones of a sensor cover, rad.
double horizontal_field(const Sensor& sensor) {
  double left = 0, right = 0;
  for (const Zone& zone : sensor.zones) {
    const auto* footprint = std::get_if<AngularRectangle>(&zone.footprint);
    if (footprint == nullptr) continue;
    left = std::min(left, footprint->left);
    right = std::max(right, footprint->right);
  }
  return right - left;
}

DirectSight read_sight(const JsonReader& reader, const Sensor& sensor) {
  DirectSight sight;
  sight.field_of_view = horizontal_field(sensor);
  if (!reader.present()) return sight;
  reader.allow_only({"fov_deg", "range_m"});
  sight.field_of_view =
      reader.at("fov_deg").number_or(sight.field_of_view / kDegree,
                                     NumberRange{.lower = 0, .upper = 360, .above_lower = true}) *
      kDegree;
  sight.range = reader.at("range_m").number_or(sight.range, NumberRange::between(0.01, 1e5));
  return sight;
}

GridGeometry read_map(const JsonReader& reader) {
  reader.allow_only({"lower_m", "upper_m", "cell_m"});
  const Vector2d lower = read_point(reader.at("lower_m"));
  const Vector2d upper = read_point(reader.at("upper_m"));
  GridGeometry map;
  map.cell_size = reader.at("cell_m").number(NumberRange::between(1e-3, 100));
  if (!((upper - lower).minCoeff() > 0)) {
    reader.at("upper_m").fail("a corner above and to the right of lower_m");
  }
  // A side that is a whole number of cells keeps that number in spite of rounding.
  constexpr double kRounding = 1e-9;
  const Vector2d cells =
      ((upper - lower) / map.cell_size - Vector2d::Constant(kRounding)).array().ceil();
  if (cells.prod() > kMaxCells) {
    reader.at("cell_m").fail("cells of which the map has at most 4 million");
  }
  map.origin = lower;
  map.columns = static_cast<int>(cells.x());
  map.rows = static_cast<int>(cells.y());
  return map;
}

/// Name of an unknown in drive files, which state angles in degrees.
std::string file_name(const Scene& scene, const Unknown& unknown) {
  std::string name = unknown_name(scene, unknown);
  if (unknown.component == Component::yaw) name.replace(name.size() - 3, 3, "deg");
  return name;
}

TrueComponent read_component(const JsonReader& reader, const Unknown& unknown) {
  const double unit = unknown.component == Component::yaw ? kDegree : 1.0;
  // Rounding error of the scene file's degrees, which were turned into radians and back.
  const double slack = 1e-9 * unknown.range() / unit;
  if (!reader.is_array() && !reader.json().is_number()) reader.fail("a number or [lower, upper]");
  const auto [lower, upper] = read_stated_or_drawn(
      reader, NumberRange::between(unknown.lower / unit - slack, unknown.upper / unit + slack));
  return {std::max(lower * unit, unknown.lower), std::min(upper * unit, unknown.upper)};
}

/// Reads a velocity whose x and y are each stated or drawn.
void read_velocity(const JsonReader& reader, Vector2d& lower, Vector2d& upper) {
  const auto parts = reader.elements_exactly(2, "numbers or intervals");
  std::tie(lower.x(), upper.x()) = read_stated_or_drawn(parts[0], kPosition);
  std::tie(lower.y(), upper.y()) = read_stated_or_drawn(parts[1], kPosition);
}

void read_velocities(const JsonReader& reader, DriveTruth& truth) {
  if (!reader.present()) return;
  const std::size_t objects = truth.velocity.size();
  truth.velocity_upper = truth.velocity;
  if (objects == 1) {
    read_velocity(reader, truth.velocity[0], truth.velocity_upper[0]);
    return;
  }
  const auto list = reader.elements_exactly(objects, "velocities, one per hidden object");
  for (std::size_t i = 0; i < objects; ++i) {
    read_velocity(list[i], truth.velocity[i], truth.velocity_upper[i]);
  }
}

void read_meeting(const JsonReader& reader, DriveTruth& truth) {
  if (!reader.present()) return;
  reader.allow_only({"at_m", "after_s", "spread_m"});
  DriveMeeting meeting;
  meeting.point = read_point(reader.at("at_m"));
  meeting.time = reader.at("after_s").number(kDelay);
  meeting.spread = reader.at("spread_m").number_or(0, NumberRange::between(0, 100));
  truth.meeting = meeting;
}

void read_turn(const JsonReader& reader, DriveTruth& truth) {
  if (!reader.present()) return;
  reader.allow_only({"after_s", "velocity_m_per_s"});
  DriveTurn turn{.time = reader.at("after_s").number(kDelay), .velocity = truth.velocity};
  const JsonReader velocity = reader.at("velocity_m_per_s");
  if (turn.velocity.size() == 1) {
    turn.velocity[0] = read_point(velocity);
  } else {
    const auto list =
        velocity.elements_exactly(turn.velocity.size(), "velocities, one per hidden object");
    for (std::size_t i = 0; i < list.size(); ++i) turn.velocity[i] = read_point(list[i]);
  }
  truth.turn = turn;
}

DriveTruth read_truth(const JsonReader& reader, const Scene& scene) {
  DriveTruth truth;
  truth.components.resize(scene.unknowns.size());
  truth.velocity.assign(static_cast<std::size_t>(object_count(scene)), Vector2d::Zero());
  if (!reader.present()) return truth;
  std::vector<std::string> names;
  for (const Unknown& unknown : scene.unknowns) names.push_back(file_name(scene, unknown));
  std::vector<std::string_view> fields(names.begin(), names.end());
  fields.insert(fields.end(), {"present", "velocity_m_per_s", "meeting", "turn"});
  reader.allow_only(fields);
  if (const JsonReader present = reader.at("present"); present.present()) {
    const bool stated = present.json().is_boolean();
    if (!stated && !present.json().is_number()) present.fail("true, false or a probability");
    truth.present = stated ? (present.boolean() ? 1 : 0) : present.number(kShare);
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    const JsonReader field = reader.at(names[i]);
    if (field.present()) truth.components[i] = read_component(field, scene.unknowns[i]);
  }
  read_velocities(reader.at("velocity_m_per_s"), truth);
  read_meeting(reader.at("meeting"), truth);
  read_turn(reader.at("turn"), truth);
  return truth;
}

void read_perception(const JsonReader& reader, Drive& drive) {
  if (!reader.present()) return;
  reader.allow_only({"use", "delay_s", "weights"});
  drive.perception = reader.at("use").text_or(drive.perception);
  if (const JsonReader delays = reader.at("delay_s"); delays.present()) {
    for (const auto& [name, delay] : delays.fields()) drive.delay[name] = delay.number(kDelay);
  }
  if (const JsonReader weights = reader.at("weights"); weights.present()) {
    const std::filesystem::path directory = std::filesystem::path(drive.path).parent_path();
    for (const auto& [name, file] : weights.fields()) {
      drive.weights[name] = (directory / file.text()).string();
    }
  }
}

void read_lane(const JsonReader& reader, Drive& drive) {
  if (!reader.present()) return;
  reader.allow_only({"lower_m", "upper_m"});
  drive.lane.emplace(read_point(reader.at("lower_m")), read_point(reader.at("upper_m")));
  if (drive.lane->isEmpty()) {
    reader.at("upper_m").fail("a corner above and to the right of lower_m");
  }
}

/// Refuses a point that is not on the map.
void check_on_map(const JsonReader& reader, const GridGeometry& map, const Vector2d& point) {
  if (!map.contains(map.cell_at(point))) reader.fail("a point on the map");
}

void read_route(const JsonReader& reader, Drive& drive) {
  const JsonReader line = reader.at("finish_line_m"), route = reader.at("route_m");
  reader.decided_by("finish_line_m");
  if (!line.present() || route.present()) {
    for (const JsonReader& point : route.elements(1)) {
      drive.route.push_back(read_point(point));
      check_on_map(point, drive.map, drive.route.back());
    }
  }
  if (line.present()) {
    const auto ends = line.elements_exactly(2, "points, the ends of a line across the lane");
    drive.finish_line = {read_point(ends[0]), read_point(ends[1])};
    for (std::size_t i = 0; i < 2; ++i) check_on_map(ends[i], drive.map, (*drive.finish_line)[i]);
    if ((*drive.finish_line)[0] == (*drive.finish_line)[1]) ends[1].fail("another point");
  }
  check_on_map(reader.at("vehicle").at("start").at("position_m"), drive.map, drive.vehicle.start);
  drive.goal_tolerance = reader.at("goal_tolerance_m")
                             .number_or(drive.vehicle.length / 2, NumberRange::between(1e-3, 1e3));
  std::tie(drive.speed_lower, drive.speed_upper) =
      read_stated_or_drawn(reader.at("speed_m_per_s"), kSpeed);
  drive.time_limit =
      reader.at("time_limit_s")
          .number_or(drive.time_limit, NumberRange{.lower = 0, .upper = 3600, .above_lower = true});
}

/// Refuses risk and closing speed beside the wanted speed: only vehicles that choose their speed
/// use these.
void read_speed_mode(const JsonReader& reader, Drive& drive) {
  if (reader.at("speed_mode").deciding_word_or("wanted", {"wanted", "safe"}) == "safe") {
    drive.speed_mode = SpeedMode::safe;
  }
  const auto number = [&](const char* name, double absent, const NumberRange& range) {
    if (drive.speed_mode == SpeedMode::wanted) {
      reader.exclude(name, "nothing, unless speed_mode is \"safe\"");
    }
    return reader.at(name).number_or(absent, range);
  };
  drive.risk = number("risk", drive.risk, kShare);
  drive.traffic_risk = reader.at("traffic_risk").number_or(drive.traffic_risk, kShare);
  drive.closing_speed = number("closing_speed_m_per_s", 0, NumberRange::between(0, 100));
}

/// The published controller drives at constant speed.
void read_controller(const JsonReader& reader, Drive& drive) {
  const bool published =
      reader.at("controller").word_or("own", {"own", "published"}) == "published";
  if (!published) return;
  drive.controller = DriveController::published;
  if (drive.speed_mode == SpeedMode::safe) {
    reader.at("controller").fail("\"own\" where speed_mode is \"safe\"");
  }
}

void read_trials(const JsonReader& reader, Drive& drive) {
  drive.trials.speed_lower = drive.speed_lower;
  drive.trials.speed_upper = drive.speed_upper;
  if (!reader.present()) return;
  reader.allow_only({"speed_m_per_s", "zones", "corner_m", "corner_radius_m"});
  std::tie(drive.trials.speed_lower, drive.trials.speed_upper) =
      reader.at("speed_m_per_s").interval(kSpeed);
  drive.trials.zones = reader.at("zones").integer(1, 1000);
  if (reader.decided_by("corner_m")) {
    drive.trials.corner = read_point(reader.at("corner_m"));
    drive.trials.corner_radius =
        reader.at("corner_radius_m").number(NumberRange::between(0.1, 1e3));
  } else {
    reader.exclude("corner_radius_m",
                   "no radius without corner_m, of which it is the surroundings");
  }
}

/// Reads the scene beside the drive file. Errors in the scene name the scene file.
void read_named_scene(const JsonReader& reader, Drive& drive) {
  const std::filesystem::path beside = std::filesystem::path(reader.file()).parent_path();
  const std::string path = (beside / reader.text()).string();
  std::error_code unreadable;  // for example if the name is longer than the system allows
  if (!std::filesystem::exists(path, unreadable)) {
    reader.fail("a scene file, relative to the drive file");
  }
  drive.scene = read_scene(path);
  drive.motion = read_motion(path);
}

}  // namespace

Drive read_drive(const std::string& path) { return parse_drive_text(read_bytes(path), path); }

Drive parse_drive_text(const std::string& text, const std::string& path) {
  const Json document = parse_file_kind(FileKind::drive, text, path);
  const JsonReader reader(document, path);
  if (!reader.is_object()) reader.fail("an object");
  reader.allow_only({"name",          "description",
                     "scene",         "vehicle",
                     "route_m",       "goal_tolerance_m",
                     "finish_line_m", "speed_m_per_s",
                     "time_limit_s",  "sensor",
                     "direct_sight",  "map",
                     "lane",          "hidden",
                     "perception",    "trials",
                     "speed_mode",    "risk",
                     "traffic_risk",  "closing_speed_m_per_s",
                     "controller"});
  Drive drive;
  drive.path = path;
  drive.name = reader.at("name").text_or(std::filesystem::path(path).stem().string());
  reader.at("description").text_or("");
  read_named_scene(reader.at("scene"), drive);
  drive.vehicle = read_vehicle(reader.at("vehicle"));
  drive.sensor = read_drive_sensor(reader.at("sensor"));
  drive.sight = read_sight(reader.at("direct_sight"), drive.scene.sensor);
  drive.map = read_map(reader.at("map"));
  read_lane(reader.at("lane"), drive);
  drive.truth = read_truth(reader.at("hidden"), drive.scene);
  read_perception(reader.at("perception"), drive);
  read_route(reader, drive);
  read_speed_mode(reader, drive);
  read_controller(reader, drive);
  read_trials(reader.at("trials"), drive);
  drive.motion.frame_interval = 1 / drive.sensor.rate;
  return drive;
}

}  // namespace blindcorner
