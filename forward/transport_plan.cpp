// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/transport_plan.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Above this ratio of lobe footprint to lit spot the single sum of a retroreflector, whose error
/// is the light lost over the rim of the spot (about the ratio itself), is replaced by pairs.
constexpr double kSingleSumRatio = 0.05;

/// Whether the face cannot stand between any point of `a` and any point of `b`: all of them lie on
/// one side of its plane, or it lies beyond all of them along one of the world axes.
bool cannot_block(const OccluderFace& face, const std::vector<Vector3d>& points, double margin) {
  const auto& c = face.corners;
  const Vector3d normal = (c[1] - c[0]).cross(c[3] - c[0]).normalized();
  double low = 1e300;
  double high = -1e300;
  for (const Vector3d& point : points) {
    const double distance = normal.dot(point - c[0]);
    low = std::min(low, distance);
    high = std::max(high, distance);
  }
  if (low >= -margin || high <= margin) return true;
  for (int axis = 0; axis < 3; ++axis) {
    double face_low = 1e300, face_high = -1e300, point_low = 1e300, point_high = -1e300;
    for (const Vector3d& corner : c) {
      face_low = std::min(face_low, corner[axis]);
      face_high = std::max(face_high, corner[axis]);
    }
    for (const Vector3d& point : points) {
      point_low = std::min(point_low, point[axis]);
      point_high = std::max(point_high, point[axis]);
    }
    if (face_low >= point_high - margin || face_high <= point_low + margin) return true;
  }
  return false;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

}  // namespace

std::vector<Placement> probe_placements(const Scene& scene) {
  std::vector<Placement> placements{scene.hidden.placement};
  for (const Unknown& unknown : scene.unknowns) {
    std::vector<Placement> next;
    for (const Placement& placement : placements) {
      for (const double t : {0.0, 0.5, 1.0}) {
        Placement moved = placement;
        moved.set(unknown.component, unknown.lower + t * unknown.range());
        next.push_back(moved);
      }
    }
    placements = std::move(next);
  }
  return placements;
}

TransportPlan make_plan(const Scene& scene, const std::vector<Vector3d>& relay_points,
                        double lit_extent) {
  TransportPlan plan;
  const std::vector<Placement> probes = probe_placements(scene);

  // Points that span the search region: the object's bounding box at the extreme placements.
  std::vector<Vector3d> points = relay_points;
  double nearest = 1e300;
  double farthest = 0;
  for (const Placement& probe : probes) {
    const Transform T = object_to_world(scene.hidden.shape, scene.hidden.anchor, probe);
    const double radius = probe.size * bounding_radius(scene.hidden.shape, Anchor::center);
    for (int corner = 0; corner < 8; ++corner) {
      points.push_back(T.translation() + radius * Vector3d((corner & 1) != 0 ? 1 : -1,
                                                           (corner & 2) != 0 ? 1 : -1,
                                                           (corner & 4) != 0 ? 1 : -1));
    }
    for (const Vector3d& relay : relay_points) {
      nearest = std::min(nearest, (relay - T.translation()).norm());
      farthest = std::max(farthest, (relay - T.translation()).norm());
    }
  }

  const auto faces = occluder_faces(scene.surfaces);
  const double margin = 1e-6 * std::max(farthest, 1e-6);
  for (const OccluderFace& face : faces) {
    if (!cannot_block(face, points, margin)) plan.occluders.push_back(face);
  }
  plan.decisions.push_back(
      {"occlusion between relay and object", !plan.occluders.empty(),
       std::to_string(plan.occluders.size()) + " of " + std::to_string(faces.size()) +
           " occluder faces can stand between the relay and the search region"});
  plan.decisions.push_back({"self-shadowing of the object", false, "the shape is convex"});

  if (const auto* retro = std::get_if<RetroreflectiveMaterial>(&scene.hidden.material)) {
    const double ratio = lit_extent > 0 ? retro->lobe_sigma * farthest / lit_extent : 0.0;
    plan.kernel = ratio <= kSingleSumRatio ? Kernel::retro_single : Kernel::retro_pairs;
    plan.decisions.push_back(
        {"pairs of lit and seen relay patches", plan.kernel == Kernel::retro_pairs,
         "the lobe's footprint is at most " + number(ratio) + " of the lit spot"});
  } else {
    plan.decisions.push_back({"pairs of lit and seen relay patches", false,
                              "a Lambertian object's light factorises into two sums"});
  }
  return plan;
}

}  // namespace blindcorner
