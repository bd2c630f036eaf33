// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/report/drive_report.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "blindcorner/forward/scene/footprint.h"
#include "blindcorner/report/result_file.h"
#include "blindcorner/simulation/perception.h"
#include "blindcorner/simulation/true_world.h"
#include "report/birds_eye.h"
#include "report/html.h"
#include "report/json_values.h"

namespace blindcorner {
namespace {

using nlohmann::json;

/// Zones whose histograms a page shows of each frame: those with most light from the object.
constexpr std::size_t kShownZones = 9;
/// How far ahead a page shows where objects with a known velocity may go, s.
constexpr double kAhead = 0.5;

json modes_json(const PoseMixture& mixture, const std::vector<PoseVelocity>& velocities) {
  json modes = json::array();
  for (std::size_t i = 0; i < mixture.modes.size(); ++i) {
    const PoseMode& mode = mixture.modes[i];
    modes.push_back({{"weight", number_or_null(mode.weight)},
                     {"pose", numbers_json(mode.pose)},
                     {"covariance", matrix_json(mode.covariance)}});
    if (velocities.empty()) continue;
    modes.back()["velocity"] = numbers_json(velocities[i].mean);
    modes.back()["velocity_covariance"] = matrix_json(velocities[i].covariance);
  }
  return modes;
}

/// Modes of the latest answer, as it was given.
json modes_json(const DriveFrame& frame) {
  return frame.mixture ? modes_json(*frame.mixture, frame.velocities) : json::array();
}

/// The same moved on by a time, s, as the map does with what is old.
json modes_later(const Drive& drive, const DriveFrame& frame, double ahead) {
  const std::optional<PoseMixture> later = known_later(drive, frame, ahead);
  return later ? modes_json(*later, {}) : json::array();
}

json points_json(const std::vector<Eigen::Vector2d>& points) {
  json list = json::array();
  for (const Eigen::Vector2d& p : points) {
    list.push_back({with_digits(p.x(), 5), with_digits(p.y(), 5)});
  }
  return list;
}

json times_json(const DriveTimes& times) {
  return {{"sense", with_digits(times.sense, 4)},
          {"perceive", with_digits(times.perceive, 4)},
          {"map", with_digits(times.map, 4)},
          {"plan", with_digits(times.plan, 4)},
          {"control", with_digits(times.control, 4)}};
}

json frame_json(const DriveFrame& frame) {
  return {{"time_s", with_digits(frame.time, 6)},
          {"x_m", frame.vehicle.position.x()},
          {"y_m", frame.vehicle.position.y()},
          {"yaw_rad", frame.vehicle.yaw},
          {"speed_m_per_s", frame.vehicle.speed},
          {"steering_rad", frame.vehicle.steering_angle},
          {"target_speed_m_per_s", number_or_null(frame.target_speed)},
          {"braking_for", frame.braking_for.empty() ? json(nullptr) : json(frame.braking_for)},
          {"braking_m_per_s2", with_digits(frame.braking, 4)},
          {"clearance_m", number_or_null(frame.clearance)},
          {"frame", fate_word(frame.fate)},
          {"arrival_s", with_digits(frame.arrival, 6)},
          {"presence_probability",
           frame.mixture ? number_or_null(frame.mixture->presence_probability) : json(nullptr)},
          {"modes", modes_json(frame)},
          {"modes_age_s", frame.mixture ? number_or_null(frame.mixture_age) : json(nullptr)},
          {"flags", frame.flags},
          {"error", frame.error.empty() ? json(nullptr) : json(frame.error)},
          {"truth", frame.truth ? numbers_json(*frame.truth) : json(nullptr)},
          {"plan", {{"decision", frame.plan_text}, {"path_m", points_json(frame.path)}}},
          {"time_ms", times_json(frame.time_ms)}};
}

/// Occupancy of one frame in 16 steps as text, runs as "letter count": a to p, "-" for unknown.
std::string grid_text(const std::vector<double>& occupancy) {
  std::string text;
  for (std::size_t i = 0; i < occupancy.size();) {
    const auto letter_of = [&](std::size_t k) {
      const double p = occupancy[k];
      return std::isnan(p) ? '-' : static_cast<char>('a' + std::min(15, static_cast<int>(16 * p)));
    };
    const char letter = letter_of(i);
    std::size_t end = i + 1;
    while (end < occupancy.size() && letter_of(end) == letter) ++end;
    text += letter;
    if (end > i + 1) text += std::to_string(end - i);
    i = end;
  }
  return text;
}

/// The zones with most light from the object over the whole drive, in reading order.
std::vector<int> shown_zones(const DriveResult& result) {
  std::vector<double> light;
  for (const DriveFrame& frame : result.frames) {
    if (!frame.object_counts) continue;
    const HistogramCube& cube = *frame.object_counts;
    light.resize(static_cast<std::size_t>(cube.zones()));
    for (int z = 0; z < cube.zones(); ++z) {
      light[static_cast<std::size_t>(z)] +=
          std::accumulate(cube.zone(z), cube.zone(z) + cube.bins, 0.0);
    }
  }
  std::vector<int> zones(light.size());
  std::iota(zones.begin(), zones.end(), 0);
  std::ranges::stable_sort(zones, [&](int a, int b) {
    return light[static_cast<std::size_t>(a)] > light[static_cast<std::size_t>(b)];
  });
  zones.resize(std::min(zones.size(), kShownZones));
  std::ranges::sort(zones);
  return zones;
}

json zone_json(const HistogramCube& cube, int zone) {
  json bins = json::array();
  for (int k = 0; k < cube.bins; ++k) bins.push_back(with_digits(cube.zone(zone)[k], 3));
  return bins;
}

/// What a page shows of a frame beyond drive.json.
json picture_json(const Drive& drive, const DriveFrame& frame, const std::vector<int>& zones) {
  json measured = json::array(), object = json::array();
  if (frame.counts && frame.object_counts) {
    for (const int z : zones) {
      measured.push_back(zone_json(*frame.counts, z));
      object.push_back(zone_json(*frame.object_counts, z));
    }
  }
  const SensorView view = sensor_view(drive.scene, frame.T_world_sensor, {});
  return {{"grid", grid_text(frame.occupancy)},
          {"now", modes_later(drive, frame, 0)},
          {"later", frame.velocities.empty() ? json::array() : modes_later(drive, frame, kAhead)},
          {"field", points_json(view.field_of_view)},
          {"measured", measured},
          {"object", object}};
}

json world_json(const Drive& drive, const DriveResult& result) {
  json surfaces = json::array();
  for (const Surface& surface : drive.scene.surfaces) {
    surfaces.push_back(
        {{"name", surface.name},
         {"body", std::holds_alternative<BoxShape>(surface.shape)},
         {"outline", points_json(footprint(surface.shape, surface.T_world_surface))}});
  }
  json objects = json::array();
  for (int i = 0; i < object_count(drive.scene); ++i) {
    const HiddenObject& object = hidden_object(drive.scene, i);
    const Placement& known = object.placement;
    objects.push_back(
        {{"name", object.name},
         {"outline", points_json(footprint(object.shape, object.anchor, Placement{}))},
         {"known",
          {{"x_m", known.position.x()},
           {"y_m", known.position.y()},
           {"yaw_rad", known.yaw},
           {"size", known.size}}}});
  }
  json unknowns = json::array();
  for (const Unknown& unknown : drive.scene.unknowns) {
    unknowns.push_back({{"component", component_name(unknown.component)},
                        {"object", unknown.object},
                        {"range", {unknown.lower, unknown.upper}}});
  }
  json trace = json::array();
  for (const Eigen::Vector3d& at : result.trace) {
    trace.push_back({with_digits(at.x(), 5), with_digits(at.y(), 5), with_digits(at.z(), 4)});
  }
  const GridGeometry& map = drive.map;
  return {{"surfaces", surfaces},
          {"objects", objects},
          {"unknowns", unknowns},
          {"trace", trace},
          {"trace_step_s", result.trace_step},
          {"vehicle",
           {{"kind", drive.vehicle.kind == VehicleKind::car ? "car" : "robot"},
            {"length_m", drive.vehicle.length},
            {"width_m", drive.vehicle.width}}},
          {"route_m", points_json(drive.route)},
          {"goal_tolerance_m", drive.goal_tolerance},
          {"finish_line_m",
           drive.finish_line ? points_json({drive.finish_line->begin(), drive.finish_line->end()})
                             : json()},
          {"sensor_rate_hz", drive.sensor.rate},
          {"bin_width_ns", drive.scene.sensor.bin_width * 1e9},
          {"map",
           {{"origin_m", {map.origin.x(), map.origin.y()}},
            {"cell_m", map.cell_size},
            {"columns", map.columns},
            {"rows", map.rows}}}};
}

}  // namespace

json drive_json(const Drive& drive, const DriveOptions& options, const DriveResult& result) {
  json frames = json::array();
  for (const DriveFrame& frame : result.frames) frames.push_back(frame_json(frame));
  return {{"format", kDriveFormat},
          {"drive", drive.name},
          {"scene", drive.scene.name},
          {"perception", options.perception},
          {"perception_delay_s", declared_delay(drive, options.perception)},
          {"seed", options.seed},
          {"light", drive.sensor.light},
          {"outcome", outcome_word(result.outcome)},
          {"clearance_m", number_or_null(result.clearance)},
          {"length_m", result.length},
          {"time_s", result.time},
          {"wanted_speed_m_per_s", result.wanted_speed},
          {"mean_speed_m_per_s", result.mean_speed},
          {"top_speed_m_per_s", result.top_speed},
          {"unknowns", unknown_names(drive.scene)},
          {"frames", frames}};
}

std::string drive_page(const Drive& drive, const DriveOptions& options, const DriveResult& result) {
  const std::vector<int> zones = shown_zones(result);
  json pictures = json::array();
  for (const DriveFrame& frame : result.frames) {
    pictures.push_back(picture_json(drive, frame, zones));
  }
  const json data = {{"drive", drive_json(drive, options, result)},
                     {"world", world_json(drive, result)},
                     {"zones", zones},
                     {"pictures", pictures}};
  return script_page(drive.name, dump_json(data),
                     {.style = "drive_page.css", .library = {}, .script = "drive_page.js"});
}

}  // namespace blindcorner
