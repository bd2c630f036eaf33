// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/report/page.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/scene/footprint.h"
#include "blindcorner/report/headline.h"
#include "blindcorner/report/result_file.h"
#include "report/birds_eye.h"
#include "report/html.h"
#include "report/json_values.h"
#include "report/page_data.h"

namespace blindcorner {
namespace {

using nlohmann::json;

/// Five significant digits: enough for any screen, half the bytes.
json rounded(double value) {
  if (!std::isfinite(value)) return nullptr;
  const double shown = with_digits(value, 5);
  if (shown == std::trunc(shown) && std::abs(shown) < 1e9) return static_cast<long>(shown);
  return shown;
}

json outline_json(const Outline& outline) {
  json list = json::array();
  for (const auto& point : outline) list.push_back({rounded(point.x()), rounded(point.y())});
  return list;
}

json object_json(const Scene& scene, int index) {
  const HiddenObject& object = hidden_object(scene, index);
  const Placement& known = object.placement;
  // As in unknown_names(): with several objects, the name of each unknown begins with its object's.
  const std::string prefix = object_count(scene) > 1 ? object.name + "." : "";
  return {{"name", object.name},
          {"prefix", prefix},
          {"shape", shape_name(object.shape)},
          {"yaw_period", yaw_period(object.shape)},
          {"outline", outline_json(footprint(object.shape, object.anchor, Placement{}))},
          {"known",
           {{"x_m", known.position.x()},
            {"y_m", known.position.y()},
            {"z_m", known.position.z()},
            {"yaw_rad", known.yaw},
            {"size", known.size}}}};
}

json scene_json(const Scene& scene) {
  json surfaces = json::array();
  for (const Surface& surface : scene.surfaces) {
    surfaces.push_back(
        {{"name", surface.name},
         {"relay", surface.relay},
         {"occluder", surface.occluder},
         {"outline", outline_json(footprint(surface.shape, surface.T_world_surface))}});
  }
  json bounds = json::array();
  for (const Unknown& unknown : scene.unknowns) bounds.push_back({unknown.lower, unknown.upper});
  json objects = json::array();
  for (int i = 0; i < object_count(scene); ++i) objects.push_back(object_json(scene, i));
  json dead = json::array();
  json time_zero = json::array();
  for (const Zone& zone : scene.sensor.zones) {
    dead.push_back(zone.dead);
    time_zero.push_back(rounded(zone.time_zero * 1e12));
  }
  return {{"name", scene.name},
          {"surfaces", surfaces},
          {"bounds", bounds},
          {"presence_prior", number_or_null(scene.presence_prior)},
          {"objects", objects},
          {"sensor",
           {{"name", scene.sensor.name},
            {"rows", scene.sensor.rows},
            {"columns", scene.sensor.columns},
            {"bins", scene.sensor.bins},
            {"bin_width_ps", scene.sensor.bin_width * 1e12},
            {"time_zero_ps", time_zero},
            {"path_from_relay", scene.sensor.path_origin == PathOrigin::relay},
            {"confocal", scene.sensor.illumination == Illumination::confocal},
            {"dead", dead}}}};
}

json view_json(const SensorOutlines& view) {
  json zones = json::array();
  for (const std::vector<Outline>& zone : view.zones) {
    json outlines = json::array();
    for (const Outline& outline : zone) outlines.push_back(outline_json(outline));
    zones.push_back(outlines);
  }
  return {{"position", {view.position.x(), view.position.y(), view.position.z()}},
          {"forward", {view.forward.x(), view.forward.y(), view.forward.z()}},
          {"field_of_view", outline_json(view.field_of_view)},
          {"zones", zones}};
}

CaptureConditions scene_conditions(const Scene& scene) { return conditions_of(scene, Capture{}); }

/// Number of captures of one result. It is at least 1, so that the result's sensor is drawn.
std::size_t capture_count(const FitResult& result) {
  return std::max<std::size_t>({1, result.sources.size(), result.histograms.size()});
}

/// Gives every capture the number of its sensor view; captures from one place share a view.
class Views {
 public:
  explicit Views(const Scene& scene) : scene_(scene) {}

  std::size_t number_of(const CaptureConditions& conditions) {
    const Key key = key_of(conditions);
    const auto [entry, is_new] = numbers_.try_emplace(key, views_.size());
    if (is_new) {
      views_.push_back(
          view_json(sensor_outlines(scene_, conditions.T_world_sensor, conditions.relay_points)));
    }
    return entry->second;
  }
  json take() { return std::move(views_); }

 private:
  using Key = std::vector<double>;

  static Key key_of(const CaptureConditions& conditions) {
    const auto& matrix = conditions.T_world_sensor.matrix();
    Key key(matrix.data(), matrix.data() + matrix.size());
    for (const auto& point : conditions.relay_points) {
      key.insert(key.end(), point.data(), point.data() + 3);
    }
    return key;
  }

  const Scene& scene_;
  std::map<Key, std::size_t> numbers_;
  json views_ = json::array();
};

/// The zones to embed, in reading order: those with most light from the object.
std::vector<int> chosen_zones(const FittedHistograms& fitted, int most) {
  std::vector<int> zones(static_cast<std::size_t>(fitted.measured.zones()));
  std::iota(zones.begin(), zones.end(), 0);
  if (zones.size() <= static_cast<std::size_t>(most)) return zones;
  std::vector<double> light;
  for (const int z : zones) {
    const double* bins = fitted.object.zone(z);
    light.push_back(std::accumulate(bins, bins + fitted.object.bins, 0.0));
  }
  std::ranges::stable_sort(zones, [&light](int a, int b) {
    return light[static_cast<std::size_t>(a)] > light[static_cast<std::size_t>(b)];
  });
  zones.resize(static_cast<std::size_t>(most));
  std::ranges::sort(zones);
  return zones;
}

json bins_json(const HistogramCube& cube, int zone) {
  json list = json::array();
  const double* bins = cube.zone(zone);
  for (int k = 0; k < cube.bins; ++k) list.push_back(rounded(bins[k]));
  return list;
}

bool complete(const FittedHistograms& fitted) {
  const std::size_t size = fitted.measured.values.size();
  return size > 0 && fitted.model.values.size() == size && fitted.object.values.size() == size;
}

json histograms_json(const Scene& scene, const FittedHistograms& fitted,
                     const CaptureConditions& conditions, int max_zones) {
  json zones = json::array();
  const Sensor& sensor = scene.sensor;
  const bool own_bins = sensor.zones.size() == static_cast<std::size_t>(fitted.measured.zones());
  const auto at = [](const std::vector<double>& values, int z) {
    const auto index = static_cast<std::size_t>(z);
    return index < values.size() ? rounded(values[index]) : json(nullptr);
  };
  for (const int z : chosen_zones(fitted, max_zones)) {
    const auto index = static_cast<std::size_t>(z);
    const int first = own_bins ? sensor.zones[index].first_valid_bin : 0;
    const int end = own_bins ? sensor.valid_end(z) : fitted.measured.bins;
    zones.push_back({{"zone", z},
                     {"first_bin", std::max(first, fitted.first_bin)},
                     {"end_bin", std::min(end, fitted.end_bin)},
                     {"used", index >= fitted.zone_used.size() || fitted.zone_used[index]},
                     {"amplitude", at(fitted.amplitude, z)},
                     {"ambient", at(fitted.ambient, z)},
                     {"direct", at(fitted.direct, z)},
                     {"variance_floor", at(conditions.variance_floor, z)},
                     {"variance_per_count", at(conditions.variance_per_count, z)},
                     {"measured", bins_json(fitted.measured, z)},
                     {"model", bins_json(fitted.model, z)},
                     {"object", bins_json(fitted.object, z)}});
  }
  return {{"rows", fitted.measured.rows},
          {"columns", fitted.measured.columns},
          {"first_bin", fitted.first_bin},
          {"end_bin", fitted.end_bin},
          {"zones", zones}};
}

/// How many captures' histograms fit into the page.
std::size_t embeddable(const std::vector<FitResult>& results, const PageOptions& options) {
  std::size_t bins_per_capture = 1;
  for (const FitResult& result : results) {
    for (const FittedHistograms& fitted : result.histograms) {
      const int zones = std::min(options.max_zones, fitted.measured.zones());
      bins_per_capture =
          std::max(bins_per_capture, static_cast<std::size_t>(zones * fitted.measured.bins));
    }
  }
  const std::size_t affordable = static_cast<std::size_t>(options.max_bins) / bins_per_capture;
  return std::clamp<std::size_t>(affordable, 1,
                                 static_cast<std::size_t>(options.max_histogram_captures));
}

const CaptureConditions& conditions_at(
    const std::vector<std::vector<CaptureConditions>>& conditions, std::size_t result,
    std::size_t capture, const CaptureConditions& otherwise) {
  const bool known = result < conditions.size() && capture < conditions[result].size();
  return known ? conditions[result][capture] : otherwise;
}

std::size_t divided_up(std::size_t a, std::size_t b) { return (a + b - 1) / b; }

/// Adds the sensor view of each capture of each result, and the histograms of as many captures as
/// fit into the page, spread evenly. The other captures have null histograms.
void add_captures(const Scene& scene, const std::vector<FitResult>& results,
                  const std::vector<std::vector<CaptureConditions>>& conditions,
                  const PageOptions& options, json& data) {
  const CaptureConditions otherwise = scene_conditions(scene);
  Views views(scene);
  std::size_t total = 0;
  for (const FitResult& result : results) {
    total += static_cast<std::size_t>(std::ranges::count_if(result.histograms, complete));
  }
  const std::size_t shown = std::min(total, embeddable(results, options));
  std::size_t seen = 0;
  json view_numbers = json::array();
  json histograms = json::array();
  for (std::size_t r = 0; r < results.size(); ++r) {
    json own_views = json::array();
    json own_histograms = json::array();
    for (std::size_t c = 0; c < capture_count(results[r]); ++c) {
      const CaptureConditions& taken = conditions_at(conditions, r, c, otherwise);
      own_views.push_back(views.number_of(taken));
      own_histograms.push_back(nullptr);
      if (c >= results[r].histograms.size() || !complete(results[r].histograms[c])) continue;
      // Shows exactly `shown` of `total`, the first among them.
      const bool show = divided_up((seen + 1) * shown, total) != divided_up(seen * shown, total);
      ++seen;
      if (show) {
        own_histograms.back() =
            histograms_json(scene, results[r].histograms[c], taken, options.max_zones);
      }
    }
    view_numbers.push_back(own_views);
    histograms.push_back(own_histograms);
  }
  data["views"] = views.take();
  data["view_of"] = view_numbers;
  data["histograms"] = histograms;
  data["histograms_shown"] = shown;
  data["histograms_total"] = total;
  data["max_zones"] = options.max_zones;
}

std::string page_of(const Scene& scene, const json& data) {
  return script_page(scene.name.empty() ? "fit" : scene.name, data["headline"], dump_json(data),
                     {.styles = {"page.css"},
                      .libraries = {"d3.js", "poses.js", "scene_parts.js"},
                      .script = "page.js"});
}

}  // namespace

json page_scene(const Scene& scene) { return scene_json(scene); }

json page_view(const Scene& scene) {
  return view_json(sensor_outlines(scene, scene.T_world_sensor, {}));
}

json page_histograms(const Scene& scene, const FittedHistograms& fitted, int max_zones) {
  return histograms_json(scene, fitted, scene_conditions(scene), max_zones);
}

CaptureConditions conditions_of(const Scene& scene, const Capture& capture) {
  CaptureConditions conditions;
  conditions.T_world_sensor = capture.T_world_sensor.value_or(scene.T_world_sensor);
  if (capture.relay_points) conditions.relay_points = *capture.relay_points;
  for (int z = 0; z < scene.sensor.zone_count(); ++z) {
    const double exposures = std::max(capture.exposures_of(z), 1e-12);
    const VarianceLine line = scene.sensor.noise_of(z).stated_line().value_or(
        VarianceLine{0, capture.dispersion.value_or(scene.sensor.dispersion)});
    conditions.variance_floor.push_back(line.floor / exposures);
    conditions.variance_per_count.push_back(line.per_count / exposures);
  }
  return conditions;
}

std::string result_page(const Scene& scene, const std::vector<FitResult>& results,
                        const std::vector<std::vector<CaptureConditions>>& conditions,
                        const PageOptions& options) {
  json data = {{"result", result_json(scene, results)}, {"scene", scene_json(scene)}};
  data["headlines"] = json::array();
  for (const FitResult& result : results) data["headlines"].push_back(fit_headline(scene, result));
  data["headline"] = results.size() == 1 ? fit_headline(scene, results.front())  //
                                         : fits_headline(results);
  add_captures(scene, results, conditions, options, data);
  return page_of(scene, data);
}

std::string scene_page(const Scene& scene) {
  json data = {{"result", result_json(scene, {})}, {"scene", scene_json(scene)}};
  data["headline"] = "What the scene file says. Nothing is fitted yet.";
  data["views"] = json::array({view_json(sensor_outlines(scene, scene.T_world_sensor, {}))});
  return page_of(scene, data);
}

}  // namespace blindcorner
