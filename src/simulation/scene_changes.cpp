// SPDX-License-Identifier: Apache-2.0
#include "simulation/scene_changes.h"

#include <algorithm>

#include "blindcorner/forward/constants.h"
#include "blindcorner/simulation/synthetic.h"
#include "forward/relay/ray_scene.h"
#include "forward/relay/relay.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

constexpr double kAlbedoFactor = 0.5;
constexpr double kSizeFactor = 1.3;
constexpr double kBackgroundFactor = 10;
constexpr double kTimeZeroBins = 0.5;
constexpr double kTilt = 2 * kDegree;
/// Places of a second object that are tried before one near the first is taken.
constexpr int kSecondAttempts = 2000;

SceneChange albedo(const Scene& scene) {
  SceneChange change{"another albedo", "The object reflects half as much.",
                     "the object is half as bright as the scene says (its brightness has a wide "
                     "prior)",
                     "", scene};
  change.scene->hidden.albedo *= kAlbedoFactor;
  return change;
}

SceneChange size(const Scene& scene) {
  SceneChange change{"another size", "All lengths of the object are 1.3 times the stated ones.",
                     "the object is larger than the scene says", "", scene};
  change.scene->hidden.placement.size *= kSizeFactor;
  const auto is_size = [](const Unknown& u) { return u.component == Component::size; };
  if (std::ranges::any_of(scene.unknowns, is_size)) {
    change.scene.reset();
    change.left_out = "the size is an unknown of the scene";
  }
  return change;
}

SceneChange material(const Scene& scene) {
  const bool matt = std::holds_alternative<LambertianMaterial>(scene.hidden.material);
  SceneChange change{
      "another material",
      matt ? "The object is retroreflective (lobe of 1 degree) instead of matt, of the same albedo."
           : "The object is matt instead of " + material_name(scene.hidden.material) +
                 ", of the same albedo.",
      matt ? "the scene says that the object is matt, and it sends light back to where it came from"
           : "the scene says that the object is " + material_name(scene.hidden.material) +
                 ", and it is matt",
      "", scene};
  if (matt) {
    change.scene->hidden.material = RetroreflectiveMaterial{};
  } else {
    change.scene->hidden.material = LambertianMaterial{};
  }
  if (std::holds_alternative<MeasuredLawMaterial>(scene.hidden.material)) {
    change.scene.reset();
    change.left_out = "the object's brightness is a measured law";
  }
  return change;
}

SceneChange background(const Scene& scene) {
  SceneChange change{"ten times the background", "Ambient light is ten times the stated one.",
                     scene.linear.ambient == LinearMode::fixed
                         ? "the scene states the ambient light, and it is ten times that"
                         : "",
                     "", scene};
  change.scene->linear.fixed_ambient *= kBackgroundFactor;
  if (scene.linear.fixed_ambient <= 0) {
    change.scene.reset();
    change.left_out = "the scene states no ambient light";
  }
  return change;
}

SceneChange time_zero(const Scene& scene) {
  SceneChange change{"time zero off by half a bin",
                     "All light arrives half a bin later than the scene says.",
                     "the scene states time zeros that are half a bin too early", "", scene};
  for (Zone& zone : change.scene->sensor.zones) {
    zone.time_zero += kTimeZeroBins * scene.sensor.bin_width;
  }
  return change;
}

/// The relay that the sensor looks at, else the first one, and the point about which it turns.
std::pair<std::size_t, Vector3d> looked_at(const Scene& scene) {
  const Transform& T = scene.T_world_sensor;
  const auto hit = RayScene(scene.surfaces).first_hit(T.translation(), T.linear().col(0));
  if (hit && scene.surfaces[static_cast<std::size_t>(hit->surface)].relay) {
    return {static_cast<std::size_t>(hit->surface), hit->point};
  }
  const auto relay = std::ranges::find_if(scene.surfaces, &Surface::relay);
  return {static_cast<std::size_t>(relay - scene.surfaces.begin()),
          relay->T_world_surface.translation()};
}

SceneChange tilt(const Scene& scene) {
  SceneChange change{"relay tilted by 2 degrees",
                     "The relay is turned about the point that the sensor looks at: a wall about "
                     "the vertical, a floor about its y axis.",
                     "the scene's relay is 2 degrees off", "", scene};
  const auto [relay, pivot] = looked_at(scene);
  Transform& T = change.scene->surfaces[relay].T_world_surface;
  const Vector3d axis = surface_axes(T.linear().col(0)).second;
  T = Eigen::Translation3d(pivot) * Eigen::AngleAxisd(kTilt, axis) * Eigen::Translation3d(-pivot) *
      T;
  return change;
}

}  // namespace

std::vector<SceneChange> scene_changes(const Scene& scene) {
  return {albedo(scene),     size(scene),      material(scene),
          background(scene), time_zero(scene), tilt(scene)};
}

SceneChange second_object_change(const Scene& scene) {
  SceneChange change{"second object",
                     "Another object of the same kind stands somewhere in the search region.",
                     "the scene knows of one object, and there are two", "", scene};
  Scene& two = *change.scene;
  two.further_hidden.push_back(two.hidden);
  two.further_hidden.back().name = two.hidden.name + "_2";
  for (const Unknown& unknown : scene.unknowns) {
    two.unknowns.push_back(unknown);
    two.unknowns.back().object = 1;
  }
  return change;
}

PoseVector with_second_pose(const Scene& scene, const PoseVector& first, std::mt19937_64& random) {
  const double apart = 2 * bounding_radius(scene.hidden.shape, scene.hidden.anchor);
  const Vector3d position = placements_at(scene, first).front().position;
  PoseVector other = draw_pose(scene, random);
  for (int attempt = 0; attempt < kSecondAttempts; ++attempt) {
    if ((placements_at(scene, other).front().position - position).norm() >= apart) break;
    other = draw_pose(scene, random);
  }
  PoseVector both(first.size() + other.size());
  both << first, other;
  return both;
}

}  // namespace blindcorner
