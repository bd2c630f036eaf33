// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/drawn_objects.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>

#include "blindcorner/forward/error.h"
#include "blindcorner/simulation/simulated_sensor.h"
#include "forward/support/parallel.h"
#include "simulation/scene_changes.h"

namespace blindcorner {
namespace {

/// Offset of the seed for the places of second objects, which are drawn apart from the first ones.
constexpr std::uint64_t kSecondSeed = 7919;
/// ReferenceOptions::known_density. The known scene may send a thousand times the object's light,
/// so that an error of a thousandth of it matters. It is summed once for all objects.
constexpr double kKnownDensity = 2;

/// Changes that make the scene wrong about its light. The ambient light is not changed: studies
/// choose it.
std::vector<SceneChange> wrong_changes(const Scene& scene) {
  std::vector<SceneChange> changes = scene_changes(scene);
  std::erase_if(changes, [&](const SceneChange& c) {
    return c.wrong.empty() ||
           (c.scene && c.scene->linear.fixed_ambient != scene.linear.fixed_ambient);
  });
  changes.push_back(second_object_change(scene));
  return changes;
}

/// The scene with the change named `wrong`. Throws Error.
Scene true_scene(const Scene& scene, const std::string& wrong) {
  if (wrong.empty()) return scene;
  std::string names;
  for (SceneChange& change : wrong_changes(scene)) {
    if (change.name == wrong && change.scene) return std::move(*change.scene);
    if (change.name == wrong) {
      throw Error(scene_place(scene), "cannot be given " + wrong + ": " + change.left_out);
    }
    names += (names.empty() ? "" : ", ") + change.name;
  }
  throw Error("wrong", "found " + wrong + ", accepted: " + names);
}

/// Expected light of the true scene at its own sensor pose.
class LightOfTruth {
 public:
  LightOfTruth(const Scene& truth, TrueLight light, double sampling) {
    if (light == TrueLight::sensor) {
      sensor_ = std::make_unique<SimulatedSensor>(truth);
    } else {
      ReferenceOptions options = reference_sampling(sampling);
      options.known_density = kKnownDensity;
      reference_ = make_reference_renderer(truth, sensor_placement(truth), options);
    }
  }
  void light(const PoseVector& pose, DrawnObject& object) const {
    if (reference_) {
      object.three_bounce = reference_->three_bounce(pose);
      object.static_background = reference_->shadowed_background(pose);
      return;
    }
    SensedLight sensed = sensor_->light(sensor_->scene().T_world_sensor, pose);
    object.three_bounce = std::move(sensed.three_bounce);
    object.static_background = std::move(sensed.static_background);
  }

 private:
  std::unique_ptr<SimulatedSensor> sensor_;
  std::unique_ptr<ForwardModel> reference_;
};

double draw_amplitude(const LinearUnknowns& linear, std::mt19937_64& random) {
  if (linear.amplitude == LinearMode::fixed) return linear.fixed_amplitude;
  std::normal_distribution<double> log(std::log(linear.amplitude_prior.median),
                                       linear.amplitude_prior.sigma_log);
  return std::exp(log(random));
}

LinearValues linear_of(const Scene& scene, const DrawnObject& object, const Exposure& exposure) {
  LinearValues linear;
  linear.amplitude = object.amplitude;
  linear.ambient = exposure.ambient;
  linear.direct = scene.linear.fixed_direct;
  return linear;
}

}  // namespace

void DrawOptions::validate() const {
  if (objects < 1) {
    throw Error("DrawOptions.objects",
                "found " + std::to_string(objects) + ", accepted: at least 1");
  }
  if (!(sampling >= kMinSampling && sampling <= kMaxSampling)) {
    throw Error("DrawOptions.sampling",
                "found " + std::to_string(sampling) + ", accepted: 0.1 to 10");
  }
}

std::vector<WrongAssumption> wrong_assumptions(const Scene& scene) {
  std::vector<WrongAssumption> list;
  for (const SceneChange& c : wrong_changes(scene)) {
    list.push_back({c.name, c.description, c.left_out});
  }
  return list;
}

std::vector<DrawnObject> draw_objects(const Scene& scene, const DrawOptions& options,
                                      const std::function<void()>& advance) {
  options.validate();
  const Scene truth = true_scene(scene, options.wrong);
  std::mt19937_64 random(options.seed), second(options.seed + kSecondSeed);
  std::vector<DrawnObject> objects(static_cast<std::size_t>(options.objects));
  std::vector<PoseVector> poses;
  for (DrawnObject& object : objects) {
    object.pose = draw_pose(scene, random);
    object.amplitude = draw_amplitude(scene.linear, random);
    const bool alone = object_count(truth) == object_count(scene);
    poses.push_back(alone ? object.pose : with_second_pose(scene, object.pose, second));
  }
  const LightOfTruth light(truth, options.light, options.sampling);
  parallel_for(std::size_t{0}, objects.size(), [&](std::size_t i) {
    light.light(poses[i], objects[i]);
    if (advance) advance();
  });
  return objects;
}

Capture capture_of(const Scene& scene, const DrawnObject& object, const Exposure& exposure,
                   std::uint64_t seed) {
  Capture capture = capture_of_light(scene, object.three_bounce, object.static_background,
                                     linear_of(scene, object, exposure), exposure.exposures, seed);
  set_truth(scene, object.pose, capture);
  return capture;
}

Capture expected_capture_of(const Scene& scene, const DrawnObject& object,
                            const Exposure& exposure) {
  Capture capture;
  capture.exposures = exposure.exposures;
  capture.counts = expected_counts(scene, object.three_bounce, object.static_background,
                                   linear_of(scene, object, exposure));
  capture.T_world_sensor = scene.T_world_sensor;
  set_truth(scene, object.pose, capture);
  return capture;
}

Capture empty_capture(const Scene& scene, const HistogramCube& static_background,
                      const Exposure& exposure, std::uint64_t seed) {
  LinearValues linear;
  linear.amplitude = 0;
  linear.ambient = exposure.ambient;
  linear.direct = scene.linear.fixed_direct;
  const HistogramCube dark(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
  return capture_of_light(scene, dark, static_background, linear, exposure.exposures, seed);
}

HistogramCube empty_static_background(const Scene& scene) {
  return make_reference_renderer(scene, sensor_placement(scene))->static_background();
}

}  // namespace blindcorner
