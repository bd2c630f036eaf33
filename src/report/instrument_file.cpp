// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/report/instrument_file.h"

#include <algorithm>
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "io/sensor_reader.h"
#include "report/json_values.h"

namespace blindcorner {
namespace {

using Json = nlohmann::ordered_json;

/// Seven digits: the rounding is far below any standard error, and people can read the files.
Json number(double value) { return number_or_null(with_digits(value, 7)); }

/// All numbers of a value with seven digits.
Json rounded(Json value) {
  if (value.is_number_float()) return number(value.get<double>());
  if (value.is_structured()) {
    for (Json& element : value) element = rounded(element);
  }
  return value;
}

Json picoseconds(double seconds) { return number(seconds * 1e12); }

Json vector_json(const Eigen::Vector3d& v) {
  return Json::array({number(v.x()), number(v.y()), number(v.z())});
}

template <typename Value>
Json per_zone(const Scene& scene, const Value& value) {
  Json list = Json::array();
  for (const Zone& zone : scene.sensor.zones) list.push_back(value(zone));
  return list;
}

Json response_json(const ResponseShape& shape) {
  if (const auto* g = std::get_if<GaussianResponse>(&shape)) {
    return {{"type", "gaussian"}, {"fwhm_ps", picoseconds(g->sigma * kGaussianFwhm)}};
  }
  if (const auto* b = std::get_if<BoxGaussianResponse>(&shape)) {
    return {{"type", "box_gaussian"},
            {"box_ps", picoseconds(b->box)},
            {"sigma_ps", picoseconds(b->sigma)}};
  }
  if (const auto* e = std::get_if<ExponentialTailResponse>(&shape)) {
    Json tails = Json::array();
    for (const Tail& tail : e->tails) {
      tails.push_back({{"fraction", number(tail.fraction)}, {"decay_ps", picoseconds(tail.decay)}});
    }
    return {{"type", "exponential_tail"},
            {"fwhm_ps", picoseconds(e->sigma * kGaussianFwhm)},
            {"tails", std::move(tails)}};
  }
  return nullptr;  // a table is not changed
}

Json sensor_patch(const Scene& scene) {
  const Sensor& sensor = scene.sensor;
  Json patch;
  patch["bin_width_ps"] = picoseconds(sensor.bin_width);
  patch["time_zero_ps"] = per_zone(scene, [](const Zone& z) { return picoseconds(z.time_zero); });
  patch["gain"] = per_zone(scene, [](const Zone& z) { return number(z.gain); });
  for (int z = 0; z < sensor.zone_count(); ++z) patch["wrap_bins"].push_back(sensor.wrap(z));
  patch["valid_bins"] = Json::array();
  patch["dead_zones"] = Json::array();
  for (int z = 0; z < sensor.zone_count(); ++z) {
    const Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
    patch["valid_bins"].push_back({zone.first_valid_bin, sensor.valid_end(z) - 1});
    if (zone.dead) patch["dead_zones"].push_back(z);
  }
  // Written even where there is no background, because the scene may state one.
  patch["background_counts"] = per_zone(scene, [](const Zone& z) {
    Json counts = Json::array();
    for (const double value : z.background) counts.push_back(number(value));
    return counts;
  });
  if (sensor.link) {
    // A scene states either a link or gains with a radiant intensity. The patch states the gains,
    // so it removes the link and adds the radiant intensity that the link gave.
    patch["link"] = nullptr;
    patch["illumination"]["radiant_intensity_w_per_sr"] = number(sensor.radiant_intensity);
  }
  if (Json response = response_json(sensor.response.shape()); !response.is_null()) {
    patch["impulse_response"] = std::move(response);
  }
  const auto* first = std::get_if<Eigen::Vector3d>(&sensor.zones.front().footprint);
  if (first != nullptr && first->allFinite()) {
    patch["zones"] = per_zone(scene, [](const Zone& z) {
      return Json{{"relay_point_m", vector_json(std::get<Eigen::Vector3d>(z.footprint))}};
    });
  }
  patch["noise"] = rounded(noise_json(sensor));
  return patch;
}

Json linear_patch(const Scene& scene) {
  const LinearUnknowns& linear = scene.linear;
  Json patch;
  if (linear.amplitude != LinearMode::fixed) {
    patch["amplitude"]["prior"] = {{"median", number(linear.amplitude_prior.median)},
                                   {"sigma_log", number(linear.amplitude_prior.sigma_log)}};
  } else {
    patch["amplitude"]["value"] = number(linear.fixed_amplitude);
  }
  if (scene.sensor.link) patch["ambient"]["counts_per_bin"] = number(linear.fixed_ambient);
  if (!linear.ambient_prior.empty()) {
    Json mean = Json::array();
    Json sigma = Json::array();
    for (const NormalPrior& prior : linear.ambient_prior) {
      mean.push_back(number(prior.mean));
      sigma.push_back(number(prior.sigma));
    }
    patch["ambient"]["prior"] = {{"mean", std::move(mean)}, {"sigma", std::move(sigma)}};
  }
  return patch;
}

Json parameters_json(const Calibration& calibration) {
  Json list = Json::array();
  for (const CalibratedParameter& p : calibration.parameters) {
    list.push_back({{"name", p.name},
                    {"value", number(p.value)},
                    {"standard_error", p.determined ? number(p.standard_error) : Json(nullptr)},
                    {"logarithmic", p.logarithmic},
                    {"prior", number(p.prior)},
                    {"prior_sigma", number(p.prior_sigma)},
                    {"determined", p.determined}});
  }
  return list;
}

}  // namespace

Json instrument_json(const Scene& before, const Calibration& calibration) {
  const Scene& scene = calibration.scene;
  Json json;
  json["format"] = kInstrumentFormat;
  json["scene"] = scene_place(before);
  json["patch"]["sensor"] = sensor_patch(scene);
  if (const auto* law = std::get_if<MeasuredLawMaterial>(&scene.hidden.material)) {
    json["patch"]["hidden"]["material"]["measured_law"] = {
        {"cosine_exponent", number(law->cosine_exponent)},
        {"distance_exponent", number(law->distance_exponent)},
        {"axis_across", number(law->axis_across)},
        {"axis_up", number(law->axis_up)}};
  }
  json["patch"]["linear"] = linear_patch(scene);
  json["patch"]["outlier_probability"] = number(scene.outlier_probability);
  json["parameters"] = parameters_json(calibration);
  json["captures_used"] = calibration.used;
  json["left_out"] = Json::array();
  for (const LeftOutCapture& out : calibration.left_out) {
    json["left_out"].push_back({{"index", out.index}, {"reason", out.reason}});
  }
  json["wraps"] = Json::array();
  for (const ZoneWrap& wrap : calibration.wraps) {
    json["wraps"].push_back({{"zone", wrap.zone},
                             {"stated_bins", wrap.stated},
                             {"found_bins", wrap.found},
                             {"next_bins", wrap.next},
                             {"deviance_to_next", number(wrap.margin)}});
  }
  json["background"] = Json::array();
  for (const BackgroundBin& b : calibration.background) {
    json["background"].push_back({{"zone", b.zone},
                                  {"bin", b.bin},
                                  {"counts", number(b.counts)},
                                  {"standard_error", number(b.standard_error)}});
  }
  json["spot_assignments"] = Json::array();
  for (const SpotAssignment& a : calibration.assignments) {
    json["spot_assignments"].push_back({{"spots", a.spot}, {"deviance", number(a.deviance)}});
  }
  json["deviance"] = {{"before", number(calibration.deviance_before)},
                      {"after", number(calibration.deviance_after)},
                      {"bins", number(calibration.expected_deviance)}};
  json["brightness_sigma_log"] = number(calibration.brightness_log);
  json["variance_scale"] = number(calibration.variance_scale);
  json["notes"] = calibration.notes;
  return json;
}

}  // namespace blindcorner
