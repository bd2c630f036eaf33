// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/static_bounces.h"

#include <algorithm>
#include <cmath>

#include "blindcorner/forward/constants.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Whether some corner of a face of `a` and some of `b` lie on each other's front side.
bool may_face(const Surface& a, const Surface& b) {
  const auto fronts = [](const Surface& from, const Surface& to) {
    const auto to_triangles = triangulate(to.shape, to.T_world_surface, 1.0);
    for (const Triangle& face : triangulate(from.shape, from.T_world_surface, 1.0)) {
      const Vector3d normal = (face[1] - face[0]).cross(face[2] - face[0]).normalized();
      for (const Triangle& other : to_triangles) {
        for (const Vector3d& corner : other) {
          if (normal.dot(corner - face[0]) > 1e-9) return true;
        }
      }
    }
    return false;
  };
  return fronts(a, b) && fronts(b, a);
}

/// Whether a cell and a patch of another surface lie on each other's front side.
bool face_each_other(const SurfaceCell& cell, int surface, const RelayPatch& patch) {
  const Vector3d way = patch.center - cell.center;
  return patch.surface != surface && way.dot(cell.normal) > 0 && way.dot(patch.normal) < 0;
}

SurfaceCell as_cell(const RelayPatch& patch) {
  const double area = 4 * patch.half_u.cross(patch.half_v).norm();
  return {patch.center, patch.normal, patch.half_u, patch.half_v, area};
}

}  // namespace

StaticBounces::StaticBounces(const Scene& scene, const RelaySetup& setup,
                             const StaticSampling& sampling)
    : scene_(scene), setup_(setup) {
  const Sensor& sensor = scene.sensor;
  // Captures whose times count from the relay hold no returns of the known scene.
  if (sensor.path_origin == PathOrigin::relay || setup.uses_points()) return;
  std::vector<bool> faces(scene.surfaces.size(), false);
  for (std::size_t a = 0; a < scene.surfaces.size(); ++a) {
    for (std::size_t b = 0; b < scene.surfaces.size() && !faces[a]; ++b) {
      faces[a] = a != b && scene.surfaces[a].albedo > 0 && scene.surfaces[b].albedo > 0 &&
                 may_face(scene.surfaces[a], scene.surfaces[b]);
    }
  }
  if (std::none_of(faces.begin(), faces.end(), [](bool f) { return f; })) return;
  any_ = true;

  RelaySampling relay;
  relay.edge_depth = 3;
  relay.nodes = [](const RelayPatch&) { return std::array{2, 2}; };
  const bool confocal = sensor.illumination == Illumination::confocal;
  relay.divisions = sampling.field_divisions;
  if (!confocal) lit_.push_back(setup.lit(relay, false));
  relay.divisions = sampling.zone_divisions;
  for (int z = 0; z < sensor.zone_count(); ++z) {
    const bool dead = sensor.zones[static_cast<std::size_t>(z)].dead;
    seen_.push_back(dead ? std::vector<WeightedPatch>{} : setup.seen(z, relay, false));
    if (confocal) {
      lit_.push_back(dead ? std::vector<WeightedPatch>{} : setup.lit_by_zone(z, relay, false));
    }
  }

  const double pulse =
      kSpeedOfLight * std::hypot(sensor.response.core_sigma(), sensor.bin_width / std::sqrt(12.0));
  for (std::size_t i = 0; i < scene.surfaces.size(); ++i) {
    if (!faces[i]) continue;
    const Surface& surface = scene.surfaces[i];
    const double extent = 2 * bounding_radius(surface.shape, Anchor::center);
    const double edge = std::max(sampling.middle_edge * pulse, extent / sampling.most_divisions);
    for (const SurfaceCell& cell : divide(surface.shape, surface.T_world_surface, 1.0, edge, 2)) {
      const int id = static_cast<int>(i);
      const auto by = [&](const auto& lists) {
        return std::any_of(lists.begin(), lists.end(), [&](const auto& patches) {
          return std::any_of(patches.begin(), patches.end(),
                             [&](const auto& p) { return face_each_other(cell, id, p.patch); });
        });
      };
      if (by(lit_) && by(seen_)) middle_.push_back({id, cell, cell.area * surface.albedo / kPi});
    }
  }

  open_.emplace(sensor);
  for (int z = 0; z < sensor.zone_count(); ++z) add_two(*open_, z);
  add_three(*open_);
}

std::vector<Leg> StaticBounces::open_legs(const SurfaceCell& cell,
                                          const std::vector<WeightedPatch>& patches,
                                          int surface) const {
  return legs_to(cell, patches, {&setup_.surface_rays()}, surface, true);
}

/// Without a ray: whether bodies come near any straight line between a cell and patches.
bool StaticBounces::may_change(const SurfaceCell& cell, const std::vector<WeightedPatch>& patches,
                               int surface, const RayScene& bodies) const {
  return std::any_of(patches.begin(), patches.end(), [&](const WeightedPatch& p) {
    return face_each_other(cell, surface, p.patch) &&
           bodies.may_block(cell.center, p.patch.area_center,
                            p.patch.half_u.norm() + p.patch.half_v.norm());
  });
}

StaticBounces::Ways StaticBounces::ways(const SurfaceCell& cell,
                                        const std::vector<WeightedPatch>& patches, int surface,
                                        const RayScene* bodies) const {
  Ways ways{open_legs(cell, patches, surface), {}, {}};
  if (bodies == nullptr) {
    ways.shaded = ways.open;
    return ways;
  }
  ways.shaded = legs_to(cell, patches, {bodies, &setup_.surface_rays()}, surface, true);
  // Both lists are in the patches' order.
  auto left = ways.shaded.begin();
  for (Leg leg : ways.open) {
    while (left != ways.shaded.end() && left->patch < leg.patch) ++left;
    const bool some = left != ways.shaded.end() && left->patch == leg.patch;
    if (some && left->weight == leg.weight && left->length == leg.length) continue;
    leg.weight = -leg.weight;
    ways.change.push_back(leg);
    if (some) ways.change.push_back(*left);
  }
  return ways;
}

/// Source, surface p, surface r, detector.
void StaticBounces::add_two(PairSum& sum, int zone) const {
  for (const WeightedPatch& r : seen_[static_cast<std::size_t>(zone)]) {
    for (const Leg& p : open_legs(as_cell(r.patch), lit(zone), r.patch.surface)) {
      sum.add(zone, p.weight * p.cosine * r.weight, p.length + r.leg);
    }
  }
}

void StaticBounces::add_three(PairSum& sum) const {
  for (const Middle& middle : middle_) {
    std::vector<Leg> in;
    for (int z = 0; z < scene_.sensor.zone_count(); ++z) {
      if (z == 0 || lit_.size() > 1) in = open_legs(middle.cell, lit(z), middle.surface);
      if (in.empty()) continue;
      sum.add_lambertian(
          z, middle.scattered, in,
          open_legs(middle.cell, seen_[static_cast<std::size_t>(z)], middle.surface));
    }
  }
}

void StaticBounces::change_two(PairSum& sum, int zone, const RayScene& bodies) const {
  for (const WeightedPatch& r : seen_[static_cast<std::size_t>(zone)]) {
    const SurfaceCell cell = as_cell(r.patch);
    if (!may_change(cell, lit(zone), r.patch.surface, bodies)) continue;
    for (const Leg& p : ways(cell, lit(zone), r.patch.surface, &bodies).change) {
      sum.add(zone, p.weight * p.cosine * r.weight, p.length + r.leg);
    }
  }
}

/// With ways in i + di and ways out o + do, the change of i o is di o + (i + di) do.
void StaticBounces::change_three(PairSum& sum, const RayScene& bodies) const {
  for (const Middle& middle : middle_) {
    const auto find = [&](const std::vector<WeightedPatch>& patches, bool changes) {
      return ways(middle.cell, patches, middle.surface, changes ? &bodies : nullptr);
    };
    const auto may = [&](const std::vector<WeightedPatch>& patches) {
      return may_change(middle.cell, patches, middle.surface, bodies);
    };
    std::optional<Ways> in;  // where it matters
    for (int z = 0; z < scene_.sensor.zone_count(); ++z) {
      const std::vector<WeightedPatch>& seen = seen_[static_cast<std::size_t>(z)];
      if (z == 0 || lit_.size() > 1) {
        in.reset();
        if (may(lit(z))) in = find(lit(z), true);
      }
      const bool in_changes = in && !in->change.empty();
      const bool out_may = may(seen);
      if (!in_changes && !out_may) continue;
      const Ways out = find(seen, out_may);
      if (in_changes) sum.add_lambertian(z, middle.scattered, in->change, out.open);
      if (out.change.empty()) continue;
      if (!in) in = find(lit(z), false);
      sum.add_lambertian(z, middle.scattered, in->shaded, out.change);
    }
  }
}

void StaticBounces::add(const RayScene* bodies, HistogramCube& cube) const {
  if (!any()) return;
  PairSum sum = *open_;
  if (bodies != nullptr) {
    for (int z = 0; z < scene_.sensor.zone_count(); ++z) change_two(sum, z, *bodies);
    change_three(sum, *bodies);
  }
  HistogramCube light(cube.rows, cube.columns, cube.bins);
  sum.finish(light);
  // Light taken away leaves rounding of either sign.
  for (std::size_t i = 0; i < cube.values.size(); ++i) {
    cube.values[i] += std::max(light.values[i], 0.0);
  }
}

}  // namespace blindcorner
