// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/synthetic.h"

#include <algorithm>
#include <functional>
#include <numeric>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/validate.h"

namespace blindcorner {
namespace {

/// The time gate is the brightest bins that together hold this share of the light.
constexpr double kGateShare = 0.9;
/// Number of poses in the search region whose mean light defines an exposure.
constexpr int kTypicalPoses = 64;

int gate_bins(const Scene& scene, const HistogramCube& light) {
  std::vector<double> values;
  for (int z = 0; z < light.zones(); ++z) {
    if (scene.sensor.zones[static_cast<std::size_t>(z)].dead) continue;
    values.insert(values.end(), light.zone(z), light.zone(z) + light.bins);
  }
  std::sort(values.begin(), values.end(), std::greater<>());
  const double total = std::accumulate(values.begin(), values.end(), 0.0);
  double sum = 0;
  int count = 0;
  while (sum < kGateShare * total) sum += values[static_cast<std::size_t>(count++)];
  return std::max(count, 1);
}

}  // namespace

PoseVector draw_pose(const Scene& scene, std::mt19937_64& random) {
  validate(scene);
  PoseVector pose(static_cast<Eigen::Index>(scene.unknowns.size()));
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    const Unknown& unknown = scene.unknowns[i];
    auto& value = pose[static_cast<Eigen::Index>(i)];
    std::uniform_real_distribution<double> uniform(unknown.lower, unknown.upper);
    value = uniform(random);
    if (!unknown.prior) continue;
    std::normal_distribution<double> normal(unknown.prior->mean, unknown.prior->sigma);
    for (int attempt = 0; attempt < 1000; ++attempt) {
      const double drawn = normal(random);
      if (drawn < unknown.lower || drawn > unknown.upper) continue;
      value = drawn;
      break;
    }
  }
  return pose;
}

double total_light(const ForwardModel& model, const PoseVector& pose) {
  const HistogramCube light = model.three_bounce(pose);
  return std::accumulate(light.values.begin(), light.values.end(), 0.0);
}

double total_counts(const Scene& scene, const HistogramCube& light) {
  double counts = 0;
  for (int z = 0; z < light.zones(); ++z) {
    const Zone& zone = scene.sensor.zones[static_cast<std::size_t>(z)];
    if (zone.dead) continue;
    counts += zone.gain * std::accumulate(light.zone(z), light.zone(z) + light.bins, 0.0);
  }
  return counts;
}

double equal_ambient(const Scene& scene, const HistogramCube& light) {
  return kGateShare * total_counts(scene, light) / gate_bins(scene, light);
}

Exposure own_exposure(const Scene& scene) { return {1.0, scene.linear.fixed_ambient}; }

Exposure exposure_for(const Scene& scene, const ForwardModel& model, double photons,
                      std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const double amplitude = scene.linear.amplitude == LinearMode::fixed
                               ? scene.linear.fixed_amplitude
                               : scene.linear.amplitude_prior.median;
  double counts = 0, ambient = 0;
  for (int i = 0; i < kTypicalPoses; ++i) {
    const HistogramCube light = model.three_bounce(draw_pose(scene, random));
    counts += amplitude * total_counts(scene, light) / kTypicalPoses;
    ambient += amplitude * equal_ambient(scene, light) / kTypicalPoses;
  }
  if (!(counts > 0)) {
    throw Error("photons", "found " + std::to_string(photons) +
                               ", accepted: none, because no place of the search region sends the "
                               "sensor any light");
  }
  Exposure exposure = own_exposure(scene);
  exposure.exposures = photons / counts;
  if (scene.linear.ambient != LinearMode::fixed) exposure.ambient = ambient;
  return exposure;
}

Capture capture_of_light(const Scene& scene, const HistogramCube& three_bounce,
                         const HistogramCube& static_background, const LinearValues& linear,
                         double exposures, std::uint64_t seed) {
  Capture capture;
  capture.exposures = exposures;
  const HistogramCube expected = expected_counts(scene, three_bounce, static_background, linear);
  capture.counts = draw_counts(scene, expected, exposures, seed);
  capture.T_world_sensor = scene.T_world_sensor;
  return capture;
}

void set_truth(const Scene& scene, const PoseVector& pose, Capture& capture) {
  capture.truth.clear();
  const std::vector<std::string> names = unknown_names(scene);
  for (std::size_t i = 0; i < names.size(); ++i) {
    capture.truth[names[i]] = pose[static_cast<Eigen::Index>(i)];
  }
}

Capture make_capture(const Scene& scene, const ForwardModel& model, const PoseVector& pose,
                     const LightBudget& budget, std::uint64_t seed) {
  const HistogramCube light = model.three_bounce(pose);
  LinearValues linear;
  linear.amplitude = budget.amplitude * scene.linear.fixed_amplitude;
  linear.ambient = scene.linear.fixed_ambient;
  linear.direct = scene.linear.fixed_direct;
  double exposures = 1.0;
  if (budget.third_bounce_photons) {
    const double counts = linear.amplitude * total_counts(scene, light);
    if (!(counts > 0)) {
      throw Error("synthetic capture",
                  "the object at this pose sends the sensor no light, "
                  "accepted: a pose that some exposure can show");
    }
    exposures = *budget.third_bounce_photons / counts;
    // A background that the scene states is kept, because the fit will assume it.
    if (scene.linear.ambient != LinearMode::fixed) {
      linear.ambient = budget.background_ratio * linear.amplitude * equal_ambient(scene, light);
    }
  }
  Capture capture =
      capture_of_light(scene, light, model.shadowed_background(pose), linear, exposures, seed);
  set_truth(scene, pose, capture);
  return capture;
}

}  // namespace blindcorner
