// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/report/drive_report.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "blindcorner/forward/scene/footprint.h"
#include "blindcorner/io/program_name.h"
#include "blindcorner/report/result_file.h"
#include "blindcorner/simulation/perception.h"
#include "blindcorner/simulation/true_world.h"
#include "report/birds_eye.h"
#include "report/formatted.h"
#include "report/html.h"
#include "report/json_values.h"

namespace blindcorner {
namespace {

using nlohmann::json;

/// A page shows the histograms of this many zones: those with most light from the object.
constexpr std::size_t kShownZones = 9;
/// A page shows where objects with a known velocity may be this much later, s.
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

/// Modes of the latest answer, as they were given.
json modes_json(const DriveFrame& frame) {
  return frame.mixture ? modes_json(*frame.mixture, frame.velocities) : json::array();
}

/// These modes `ahead` seconds after the frame, moved on as the map moves old answers.
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

/// Occupancy of one frame as text, in 16 steps "a" to "p", with "-" for unknown. A run of equal
/// cells is its letter and their number.
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

std::string vehicle_word(const Drive& drive) {
  return drive.vehicle.kind == VehicleKind::car ? "car" : "robot";
}

/// Decimals of a speed in m/s. A robot's speed is a fraction of 1 m/s and needs two.
int speed_digits(const Drive& drive) { return drive.vehicle.kind == VehicleKind::car ? 1 : 2; }

/// Why the vehicle stands: what it last braked for, or that no plan led on.
std::string standing_reason(const DriveResult& result) {
  const auto braked = std::find_if(result.frames.rbegin(), result.frames.rend(),
                                   [](const DriveFrame& f) { return !f.braking_for.empty(); });
  if (braked == result.frames.rend()) return "no plan led on";
  return braked->braking_for == "no plan" ? "no plan led on"
                                          : "it braked for " + braked->braking_for;
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
  const SensorOutlines view = sensor_outlines(drive.scene, frame.T_world_sensor, {});
  return {{"grid", grid_text(frame.occupancy)},
          {"now", modes_later(drive, frame, 0)},
          {"later", frame.velocities.empty() ? json::array() : modes_later(drive, frame, kAhead)},
          {"field", points_json(view.field_of_view)},
          {"measured", measured},
          {"object", object}};
}

/// The speed of the impact as text: km/h for a car, m/s for a robot.
std::string at_speed(const Drive& drive, const DriveResult& result) {
  return drive.vehicle.kind == VehicleKind::car ? formatted(" at %.0f km/h", 3.6 * result.end_speed)
                                                : formatted(" at %.2f m/s", result.end_speed);
}

/// How the drive ended, and what was in the way.
std::string end_sentence(const Drive& drive, const DriveResult& result) {
  const std::string vehicle = vehicle_word(drive);
  const std::string driven = formatted(" after %.1f s and %.1f m", result.time, result.length);
  switch (result.outcome) {
    case DriveOutcome::reached:
      return "The " + vehicle + " reached its goal" + driven +
             formatted(", at %.*f m/s in the mean.", speed_digits(drive), result.mean_speed);
    case DriveOutcome::collision:
      return "The " + vehicle + " hit the " + (result.hit.empty() ? "wall" : result.hit) +
             at_speed(drive, result) + driven + ".";
    case DriveOutcome::stopped:
      return "The " + vehicle + " stood still" + driven +
             " and gave up: " + standing_reason(result) + ".";
    case DriveOutcome::timeout:
      return formatted("Time was over after %.1f s: the ", result.time) + vehicle +
             formatted(" had driven %.1f m and not reached its goal.", result.length);
  }
  return "";
}

/// How the drive ended, as a verb with the vehicle as its subject: "reaches its goal".
std::string ending_of(const Drive& drive, const DriveResult& result) {
  switch (result.outcome) {
    case DriveOutcome::reached:
      return "reaches its goal";
    case DriveOutcome::collision:
      return "hits the " + (result.hit.empty() ? "wall" : result.hit) + at_speed(drive, result);
    case DriveOutcome::stopped:
      return "stands still before its goal";
    case DriveOutcome::timeout:
      return "is under way when time is over";
  }
  return "";
}

/// What was known of the hidden before direct sight, and when.
struct Knowledge {
  std::optional<double> sight;  ///< s, of the first frame in direct sight
  std::optional<double> sure;   ///< s, of the first sure answer before that
  bool granted = false;         ///< the first answer was sure already: nothing was found out
};

Knowledge knowledge_of(const DriveResult& result) {
  constexpr double kSure = 0.95;
  Knowledge knowledge;
  const auto sight = std::ranges::find(result.frames, FrameFate::in_sight, &DriveFrame::fate);
  if (sight != result.frames.end()) knowledge.sight = sight->time;
  const auto told = std::find_if(result.frames.begin(), sight,
                                 [](const DriveFrame& frame) { return frame.mixture.has_value(); });
  const auto sure = std::find_if(told, sight, [](const DriveFrame& frame) {
    return frame.mixture && frame.mixture->presence_probability >= kSure;
  });
  if (sure != sight) knowledge.sure = sure->time;
  knowledge.granted = sure != sight && sure == told;
  return knowledge;
}

/// Since when the vehicle knew of what is hidden. Most of a drive depends on this.
std::string knowledge_sentence(const Drive& drive, const DriveResult& result) {
  const auto truth = std::ranges::find_if(
      result.frames, [](const DriveFrame& frame) { return frame.truth.has_value(); });
  if (truth == result.frames.end()) return "Nothing was hidden.";
  const auto [sight, sure, granted] = knowledge_of(result);
  const std::string hidden =
      object_count(drive.scene) == 1 ? hidden_object(drive.scene, 0).name : "hidden objects";
  const char* one = object_count(drive.scene) == 1 ? "it" : "one of them";
  if (!sure) {
    return sight ? formatted("It saw the %s from %.1f s on and was not sure before.",
                             hidden.c_str(), *sight)
                 : "It never was sure of the " + hidden + ".";
  }
  const std::string since =
      granted ? formatted("It took the %s to be there from the start", hidden.c_str())
              : formatted("It was sure of the %s from %.1f s on", hidden.c_str(), *sure);
  return sight ? since + formatted(", %.1f s before it saw %s directly.", *sight - *sure, one)
               : since + " and never saw " + one + " directly.";
}

/// The value, with all its numbers rounded to this many significant digits.
json shortened(json value, int digits) {
  if (value.is_number_float()) return with_digits(value.get<double>(), digits);
  if (value.is_structured()) {
    for (json& part : value) part = shortened(std::move(part), digits);
  }
  return value;
}

/// A plan with at most kMost of its points, and its last one.
json thinned(const std::vector<Eigen::Vector2d>& path) {
  constexpr std::size_t kMost = 40;
  std::vector<Eigen::Vector2d> points;
  const std::size_t step = path.size() / kMost + 1;
  for (std::size_t i = 0; i < path.size(); i += step) points.push_back(path[i]);
  if (!path.empty()) points.push_back(path.back());
  return points_json(points);
}

/// What a replay needs of a frame. It does without the modes as they were given and the run times.
json replayed_frame(const DriveFrame& frame) {
  json kept = frame_json(frame);
  for (const char* unused : {"modes", "modes_age_s", "flags", "error", "time_ms", "arrival_s"}) {
    kept.erase(unused);
  }
  kept["plan"]["path_m"] = thinned(frame.path);
  return kept;
}

/// Corners of the part of the map that the vehicle and hidden objects visit, with a margin, m.
json extent_json(const Drive& drive, const DriveResult& result) {
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector3d& at : result.trace) box.extend(Eigen::Vector2d(at.head<2>()));
  for (const DriveFrame& frame : result.frames) {
    box.extend(frame.vehicle.position);
    if (!frame.truth) continue;
    for (const Placement& placed : placements_at(drive.scene, *frame.truth)) {
      box.extend(Eigen::Vector2d(placed.position.head<2>()));
    }
  }
  const Eigen::Vector2d room = Eigen::Vector2d::Constant(drive.vehicle.length);
  const GridGeometry& map = drive.map;
  const Eigen::Vector2d size(map.columns * map.cell_size, map.rows * map.cell_size);
  return points_json(
      {(box.min() - room).cwiseMax(map.origin), (box.max() + room).cwiseMin(map.origin + size)});
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
           {{"kind", vehicle_word(drive)},
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

std::string perception_phrase(const std::string& perception) {
  if (perception == "los") return "with direct sight only";
  if (perception == "los_cautious") return "with direct sight only and care";
  if (perception == "oracle") return "told the truth";
  return "with " + (perception == "solver" ? "the solver" : perception);
}

std::string drive_headline(const Drive& drive, const DriveResult& result) {
  return end_sentence(drive, result) + " " + knowledge_sentence(drive, result) +
         (std::isfinite(result.clearance) && result.clearance > 0
              ? formatted(" It was never nearer to anything than %.2f m.", result.clearance)
              : "");
}

json drive_json(const Drive& drive, const DriveOptions& options, const DriveResult& result) {
  json frames = json::array();
  for (const DriveFrame& frame : result.frames) frames.push_back(frame_json(frame));
  const Knowledge known = knowledge_of(result);
  return {{"format", kDriveFormat},
          {"program", program_name()},
          {"drive", drive.name},
          {"scene", drive.scene.name},
          {"perception", options.perception},
          {"perception_delay_s", declared_delay(drive, options.perception)},
          {"real_time", options.real_time},
          {"seed", options.seed},
          {"light", drive.sensor.light},
          {"outcome", outcome_word(result.outcome)},
          {"headline", drive_headline(drive, result)},
          {"hit", result.hit.empty() ? json(nullptr) : json(result.hit)},
          {"sure_from_s", known.sure && !known.granted ? json(*known.sure) : json(nullptr)},
          {"clearance_m", number_or_null(result.clearance)},
          {"length_m", result.length},
          {"time_s", result.time},
          {"wanted_speed_m_per_s", result.wanted_speed},
          {"mean_speed_m_per_s", result.mean_speed},
          {"top_speed_m_per_s", result.top_speed},
          {"end_speed_m_per_s", result.end_speed},
          {"unknowns", unknown_names(drive.scene)},
          {"frames", frames}};
}

json drive_replay(const Drive& drive, const DriveOptions& options, const DriveResult& result) {
  json pictures = json::array(), frames = json::array();
  for (const DriveFrame& frame : result.frames) {
    json picture = picture_json(drive, frame, {});
    picture["grid"] = "";
    pictures.push_back(shortened(std::move(picture), 5));
    frames.push_back(shortened(replayed_frame(frame), 5));
  }
  json whole = drive_json(drive, options, result);
  whole["frames"] = std::move(frames);
  return {{"perception", options.perception},       {"ending", ending_of(drive, result)},
          {"extent_m", extent_json(drive, result)}, {"drive", std::move(whole)},
          {"world", world_json(drive, result)},     {"pictures", std::move(pictures)}};
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
  return script_page(drive.name, data["drive"]["headline"], dump_json(data),
                     {.styles = {"player.css", "drive_page.css"},
                      .libraries = {"drive_map.js"},
                      .script = "drive_page.js"});
}

}  // namespace blindcorner
