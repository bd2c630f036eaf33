// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/rendering.h"

#include <algorithm>
#include <memory>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/simulation/sensor_path.h"
#include "blindcorner/simulation/synthetic.h"
#include "forward/support/parallel.h"

namespace blindcorner {
namespace {

/// Seeds of the captures' photons are this far apart.
constexpr std::uint64_t kSeedStep = 1'000'003;
/// From so many photons on, the reference renderer's own error is a third of their noise. The error
/// is 0.2 to 0.5 % of the light if something stands in its way (tmf8828_wall).
constexpr double kBright = 1e5;
/// Sampling that leaves a fifth of this error, for ten times the time.
constexpr double kBrightSampling = 2;

ReferenceOptions reference_options(const RenderOptions& wanted) {
  const double usual = wanted.photons > kBright ? kBrightSampling : 1;
  ReferenceOptions options = reference_sampling(wanted.sampling.value_or(usual));
  options.zone_divisions = wanted.zone_divisions.value_or(options.zone_divisions);
  options.field_divisions = wanted.field_divisions.value_or(options.field_divisions);
  return options;
}

/// The scene with every component free, so that a pose may set any of them.
Scene fully_free(const Scene& scene) {
  Scene free = scene;
  free.unknowns.clear();
  for (int object = 0; object < object_count(scene); ++object) {
    for (const Component component :
         {Component::x, Component::y, Component::z, Component::yaw, Component::size}) {
      const double value = hidden_object(scene, object).placement.get(component);
      Unknown unknown{component, value, value, {}, object};
      for (const Unknown& known : scene.unknowns) {
        if (known.component == component && known.object == object) unknown = known;
      }
      free.unknowns.push_back(unknown);
    }
  }
  return free;
}

Capture render_one(const RenderOptions& options, const Scene& scene, const Scene& free,
                   const ForwardModel& model, const std::vector<Placement>& placements,
                   std::uint64_t seed) {
  const PoseVector pose = pose_of(placements, free.unknowns);
  Capture capture;
  if (options.noiseless || options.empty) {
    const HistogramCube light =
        options.empty ? HistogramCube(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins)
                      : model.three_bounce(pose);
    // Without noise: S plus static, in W/m^2 per W/sr, when gains and amplitude are one.
    const LinearValues linear{scene.linear.fixed_amplitude,
                              options.noiseless ? 0.0 : scene.linear.fixed_ambient,
                              scene.linear.fixed_direct, options.noiseless ? 0.0 : 1.0};
    const HistogramCube known =
        options.empty ? model.static_background() : model.shadowed_background(pose);
    capture.counts = expected_counts(scene, light, known, linear);
    if (options.noiseless) {
      saturate(scene.sensor, capture.counts);
    } else {
      capture.counts = draw_counts(scene, capture.counts, 1.0, seed);
    }
  } else {
    LightBudget budget;
    if (options.photons > 0) budget.third_bounce_photons = options.photons;
    capture = make_capture(free, model, pose, budget, seed);
  }
  capture.T_world_sensor = scene.T_world_sensor;
  capture.truth.clear();
  if (!options.empty) set_truth(scene, pose_of(placements, scene.unknowns), capture);
  return capture;
}

/// Widens the search region to all rendered poses, because the models' plans hold only within it.
void widen_to(Scene& free, const std::vector<std::vector<Placement>>& captures) {
  for (Unknown& unknown : free.unknowns) {
    for (const std::vector<Placement>& placements : captures) {
      const double value =
          placements[static_cast<std::size_t>(unknown.object)].get(unknown.component);
      unknown.lower = std::min(unknown.lower, value);
      unknown.upper = std::max(unknown.upper, value);
    }
  }
}

}  // namespace

void RenderOptions::validate() const {
  const auto require = [](bool condition, const char* field, const char* accepted) {
    if (!condition)
      throw Error(std::string("RenderOptions.") + field, std::string("accepted: ") + accepted);
  };
  require(model == "reference" || model == "fast", "model", "reference, fast");
  require(photons >= 0 && photons <= 1e18, "photons", "0 to 1e18");
  require(!sampling || (*sampling >= 0.1 && *sampling <= 10), "sampling", "0.1 to 10");
  for (const auto& divisions : {zone_divisions, field_divisions}) {
    require(!divisions || (*divisions >= 1 && *divisions <= 1000),
            "zone_divisions and field_divisions", "1 to 1000");
  }
  fast.validate();
}

std::size_t capture_count(std::size_t placements, std::size_t sensors) {
  const std::size_t count = std::max(placements, sensors);
  for (const std::size_t size : {placements, sensors}) {
    if (size == 1 || (size == count && size > 0)) continue;
    throw Error("render", "found " + std::to_string(placements) + " poses of the object and " +
                              std::to_string(sensors) +
                              " of the sensor, accepted: as many, or one of either");
  }
  return count;
}

CaptureFile render_captures(const Scene& scene,
                            const std::vector<std::vector<Placement>>& placements,
                            const std::vector<Transform>& sensors, const RenderOptions& options,
                            const RenderHooks& hooks) {
  options.validate();
  const std::size_t count = capture_count(placements.size(), sensors.size());
  std::vector<Scene> seen;  // [sensors]
  for (const Transform& pose : sensors) seen.push_back(seen_from(scene, pose));
  const auto stopped = [&hooks] { return hooks.stop && hooks.stop(); };
  CaptureFile file;
  file.bin_width = scene.sensor.bin_width;
  file.sensor = scene.sensor.name;
  file.description = "rendered from scene " + scene.name + " by the " + options.model + " model";
  file.captures.resize(count);
  parallel_for(std::size_t{0}, sensors.size(), [&](std::size_t s) {
    if (stopped()) return;
    Scene free = fully_free(seen[s]);
    widen_to(free, placements);
    const SensorPlacement sensor = sensor_placement(free);
    const std::unique_ptr<ForwardModel> model =
        options.model == "fast" ? make_fast_model(free, sensor, options.fast)
                                : make_reference_renderer(free, sensor, reference_options(options));
    const std::size_t first = sensors.size() == 1 ? 0 : s;
    const std::size_t end = sensors.size() == 1 ? count : s + 1;
    parallel_for(first, end, [&](std::size_t i) {
      if (stopped()) return;
      file.captures[i] =
          render_one(options, seen[s], free, *model, placements[placements.size() == 1 ? 0 : i],
                     options.seed + kSeedStep * (i + 1));
      file.captures[i].index = static_cast<int>(i);
      if (hooks.advance) hooks.advance();
    });
  });
  return file;
}

}  // namespace blindcorner
