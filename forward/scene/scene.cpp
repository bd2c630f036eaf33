// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/scene/scene.h"

#include <cmath>

#include "forward/support/overloaded.h"

namespace blindcorner {

int object_count(const Scene& scene) { return 1 + static_cast<int>(scene.further_hidden.size()); }

const HiddenObject& hidden_object(const Scene& scene, int object) {
  if (object == 0) return scene.hidden;
  return scene.further_hidden.at(static_cast<std::size_t>(object) - 1);
}

std::vector<Placement> placements_at(const Scene& scene, const PoseVector& pose) {
  std::vector<Placement> placements;
  for (int i = 0; i < object_count(scene); ++i) {
    placements.push_back(place(hidden_object(scene, i).placement, scene.unknowns, pose, i));
  }
  return placements;
}

std::vector<Placement> stated_placements(const Scene& scene) {
  std::vector<Placement> placements;
  for (int i = 0; i < object_count(scene); ++i) {
    placements.push_back(hidden_object(scene, i).placement);
  }
  return placements;
}

std::string material_name(const Material& material) {
  return std::visit(
      overloaded{[](const LambertianMaterial&) -> std::string { return "Lambertian"; },
                 [](const RetroreflectiveMaterial&) -> std::string { return "retroreflective"; },
                 [](const MeasuredLawMaterial&) -> std::string { return "measured law"; },
                 [](const BrdfMaterial& m) { return m.name; }},
      material);
}

std::string scene_place(const Scene& scene) { return scene.path.empty() ? scene.name : scene.path; }

Scene only_object(const Scene& scene, int object) {
  Scene alone = scene;
  alone.hidden = hidden_object(scene, object);
  alone.further_hidden.clear();
  alone.unknowns.clear();
  for (Unknown unknown : scene.unknowns) {
    if (unknown.object != object) continue;
    unknown.object = 0;
    alone.unknowns.push_back(unknown);
  }
  return alone;
}

std::string unknown_name(const Scene& scene, const Unknown& unknown) {
  std::string name = component_name(unknown.component);
  if (object_count(scene) == 1) return name;
  return hidden_object(scene, unknown.object).name + "." + name;
}

std::vector<std::string> unknown_names(const Scene& scene) {
  std::vector<std::string> names;
  for (const Unknown& unknown : scene.unknowns) names.push_back(unknown_name(scene, unknown));
  return names;
}

std::vector<double> periods(const Scene& scene) {
  std::vector<double> periods;
  for (const Unknown& u : scene.unknowns) {
    periods.push_back(
        u.component == Component::yaw ? yaw_period(hidden_object(scene, u.object).shape) : 0.0);
  }
  return periods;
}

PoseVector pose_error(const Scene& scene, const PoseVector& estimate, const PoseVector& truth) {
  PoseVector error = estimate - truth;
  const std::vector<double> wraps = periods(scene);
  for (std::size_t i = 0; i < wraps.size(); ++i) {
    double& e = error[static_cast<Eigen::Index>(i)];
    if (wraps[i] > 0) e = std::remainder(e, wraps[i]);
  }
  return error;
}

}  // namespace blindcorner
