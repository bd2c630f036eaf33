// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/sensor/link_budget.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <numeric>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/validate.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "forward/relay/relay_setup.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

constexpr double kPlanck = 6.62607015e-34;   // J s, exact (SI)
constexpr double kBoltzmann = 1.380649e-23;  // J/K, exact (SI)
constexpr double kStefan = 5.670374419e-8;   // W/m^2/K^4
constexpr double kSunTemperature = 5778;     // K, effective temperature of the sun
constexpr double kDaylightEfficacy = 93;     // lm/W, 683 lm/W * int V B / int B at 5778 K
constexpr double kGateShare = 0.9;           // of the light, brightest bins first
constexpr double kDistanceStep = 0.05;       // relative step of the distance exponents
constexpr double kExponentTolerance = 0.05;  // of the fast model that they come from

/// Mean counts per bin of daylight and dark counts in a zone. An even light E on a surface of
/// albedo rho sends the radiance E rho / pi; the share bin_width * repetition_rate of the exposure
/// falls into a bin.
double background(const Sensor& sensor, const Link& link, double reflected_solid_angle) {
  const double irradiance = daylight_irradiance(link.wavelength, link.ambient_illuminance) *
                            link.filter_width * reflected_solid_angle;
  const double counts = link_gain(link) * irradiance + link.dark_rate * link.exposure;
  return counts * sensor.bin_width * link.repetition_rate;
}

/// Solid angle that a pulse is spread over; confocal sensors light one zone at a time.
double lit_solid_angle(const Sensor& sensor) {
  if (sensor.illumination == Illumination::flash) return solid_angle(sensor.field);
  double sum = 0;
  for (const Zone& zone : sensor.zones) {
    sum += solid_angle(std::get<AngularRectangle>(zone.footprint));
  }
  return sum / sensor.zone_count();
}

double total(const HistogramCube& cube) {
  return std::accumulate(cube.values.begin(), cube.values.end(), 0.0);
}

/// The scene with its first hidden object alone, placed at `object`.
Scene alone_at(const Scene& scene, const Placement& object) {
  Scene alone = only_object(scene, 0);
  alone.hidden.placement = object;
  alone.unknowns.clear();
  return alone;
}

double exponent(double before, double after) {
  if (!(before > 0 && after > 0)) return 0;
  return std::log(after / before) / std::log((1 + kDistanceStep) / (1 - kDistanceStep));
}

/// Mean of the relay points that are lit and seen, m.
Vector3d lit_middle(const Scene& scene, const SensorPlacement& sensor) {
  const std::vector<Vector3d> points = RelaySetup(scene, sensor).relay_points();
  Vector3d middle = Vector3d::Zero();
  for (const Vector3d& p : points) middle += p / static_cast<double>(points.size());
  return middle;
}

}  // namespace

double photon_energy(double wavelength) { return kPlanck * kSpeedOfLight / wavelength; }

double link_gain(const Link& link) {
  const double area = kPi / 4 * link.aperture * link.aperture;
  return area * link.transmission * link.detection_efficiency * link.exposure /
         photon_energy(link.wavelength);
}

double link_radiant_intensity(const Link& link, double solid_angle) {
  return link.power() / solid_angle;
}

double daylight_irradiance(double wavelength, double illuminance) {
  const double x = kPlanck * kSpeedOfLight / (wavelength * kBoltzmann * kSunTemperature);
  const double exitance =
      2 * kPi * kPlanck * kSpeedOfLight * kSpeedOfLight / std::pow(wavelength, 5) / std::expm1(x);
  const double whole = kStefan * std::pow(kSunTemperature, 4);
  return illuminance / kDaylightEfficacy * exitance / whole;
}

void apply_link(Scene& scene, bool ambient_stated) {
  if (!scene.sensor.link) return;
  const Link& link = *scene.sensor.link;
  scene.sensor.radiant_intensity = link_radiant_intensity(link, lit_solid_angle(scene.sensor));
  for (Zone& zone : scene.sensor.zones) zone.gain = link_gain(link);
  if (ambient_stated) return;
  const RelaySetup setup(scene, sensor_placement(scene));
  double sum = 0;
  int live = 0;
  for (int z = 0; z < scene.sensor.zone_count(); ++z) {
    if (scene.sensor.zones[static_cast<std::size_t>(z)].dead) continue;
    sum += background(scene.sensor, link, setup.reflected_solid_angle(z));
    ++live;
  }
  scene.linear.fixed_ambient = live > 0 ? sum / live : 0.0;
}

std::vector<ZoneBudget> link_budget(const Scene& scene, const ForwardModel& model,
                                    const PoseVector& pose) {
  validate(scene);
  const HistogramCube light = model.three_bounce(pose);
  const HistogramCube& direct = model.static_background();
  const Sensor& sensor = scene.sensor;
  std::vector<ZoneBudget> budgets(static_cast<std::size_t>(sensor.zone_count()));
  for (int z = 0; z < sensor.zone_count(); ++z) {
    const Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
    if (zone.dead) continue;
    ZoneBudget& budget = budgets[static_cast<std::size_t>(z)];
    const double object_scale = zone.gain * scene.linear.fixed_amplitude;
    const double direct_scale = zone.gain * scene.linear.fixed_direct;
    budget.background = scene.linear.fixed_ambient;
    std::vector<std::pair<double, double>> bins;  // counts of the object, all counts
    for (int k = 0; k < light.bins; ++k) {
      const double object = object_scale * light.zone(z)[k];
      const double first = direct_scale * direct.zone(z)[k] + zone.background_at(k);
      bins.emplace_back(object, object + first + budget.background);
      budget.three_bounce += object;
      budget.direct += first;
    }
    std::sort(bins.begin(), bins.end(), std::greater<>());
    budget.peak = bins.front().first;
    double signal = 0;
    double variance = 0;
    for (const auto& [object, counts] : bins) {
      if (signal >= kGateShare * budget.three_bounce) break;
      signal += object;
      variance += count_variance(sensor, z, counts);
      ++budget.gate_bins;
    }
    budget.signal_to_noise = variance > 0 ? signal / std::sqrt(variance) : 0.0;
  }
  return budgets;
}

std::optional<double> detections_per_pulse(const Scene& scene,
                                           const std::vector<ZoneBudget>& budget) {
  if (!scene.sensor.link) return std::nullopt;
  double most = 0;
  for (const ZoneBudget& b : budget) {
    most = std::max(most, b.direct + b.three_bounce + b.background * scene.sensor.bins);
  }
  return most / (scene.sensor.link->pulses() * scene.sensor.link->detectors);
}

void decide_pile_up(TransportPlan& plan, const Scene& scene,
                    const std::vector<ZoneBudget>& budget) {
  if (scene.sensor.pile_up_cycles > 0) return;  // stated with the sensor, and corrected
  PlanDecision pile_up{Term::pile_up, "pile-up", false, "", 0.0};
  const std::optional<double> detections = detections_per_pulse(scene, budget);
  if (!detections) {
    pile_up.reason = "the scene gives no link, so the number of pulses is not known";
    pile_up.bound = std::numeric_limits<double>::infinity();
  } else {
    char text[160];
    std::snprintf(
        text, sizeof text,
        "at most %.2g detections a pulse and detector, of which a bin loses what comes before "
        "it in the pulse",
        *detections);
    pile_up.reason = text;
    pile_up.bound = -std::expm1(-*detections);
  }
  plan.decide(pile_up);
}

DistanceExponents distance_exponents(const Scene& scene, const SensorPlacement& sensor,
                                     const Placement& object) {
  validate(scene);
  const Vector3d middle = lit_middle(scene, sensor);
  const Scene alone = alone_at(scene, object);
  FastModelOptions options;
  options.tolerance = kExponentTolerance;
  // All models share one sampling, because the search for it takes longer than everything else.
  const auto transport = make_scene_transport(alone);
  options.sampling_step = choose_sampling(transport, sensor, options);
  DistanceExponents exponents;
  const auto farther_sensor = [&](double factor) {
    SensorPlacement moved = sensor;
    moved.T_world_sensor.translation() =
        middle + factor * (sensor.T_world_sensor.translation() - middle);
    return make_fast_model(transport, moved, options);
  };
  const auto farther_object = [&](double factor) {
    Placement moved = object;
    moved.position = middle + factor * (object.position - middle);
    return make_fast_model(alone_at(scene, moved), sensor, options);
  };
  const auto direct = [](const auto& model) { return total(model->static_background()); };
  const auto three_bounce = [](const auto& model) {
    return total(model->three_bounce(PoseVector()));
  };
  if (sensor.relay_points.empty()) {
    const auto near = farther_sensor(1 - kDistanceStep);
    const auto far = farther_sensor(1 + kDistanceStep);
    exponents.direct_relay = exponent(direct(near), direct(far));
    exponents.three_bounce_relay = exponent(three_bounce(near), three_bounce(far));
  }
  exponents.three_bounce_object = exponent(three_bounce(farther_object(1 - kDistanceStep)),
                                           three_bounce(farther_object(1 + kDistanceStep)));
  return exponents;
}

}  // namespace blindcorner
