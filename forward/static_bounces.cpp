// SPDX-License-Identifier: Apache-2.0
#include "static_bounces.h"

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

/// Whether a cell lies on the front side of some patch of another surface and the other way round.
bool reached(const SurfaceCell& cell, int surface, const std::vector<WeightedPatch>& patches) {
  return std::any_of(patches.begin(), patches.end(), [&](const WeightedPatch& p) {
    if (p.patch.surface == surface) return false;
    const Vector3d way = p.patch.center - cell.center;
    return way.dot(cell.normal) > 0 && way.dot(p.patch.normal) < 0;
  });
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
  relay.gauss = [](const RelayPatch&) { return true; };
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
        return std::any_of(lists.begin(), lists.end(),
                           [&](const auto& patches) { return reached(cell, id, patches); });
      };
      if (by(lit_) && by(seen_)) middle_.push_back({id, cell});
    }
  }
}

/// Source, surface p, surface r, detector.
void StaticBounces::add_two(PairSum& sum, int zone, const Blockers& blockers) const {
  for (const WeightedPatch& r : seen_[static_cast<std::size_t>(zone)]) {
    const double area = 4 * r.patch.half_u.cross(r.patch.half_v).norm();
    const SurfaceCell end{r.patch.center, r.patch.normal, r.patch.half_u, r.patch.half_v, area};
    for (const Leg& p : legs_to(end, lit(zone), blockers, r.patch.surface, true)) {
      sum.add(zone, p.weight * p.cosine * r.weight, p.length + r.leg);
    }
  }
}

void StaticBounces::add_three(PairSum& sum, const Blockers& blockers) const {
  for (const Middle& middle : middle_) {
    const double scattered =
        middle.cell.area * scene_.surfaces[static_cast<std::size_t>(middle.surface)].albedo / kPi;
    std::vector<Leg> in;
    for (int z = 0; z < scene_.sensor.zone_count(); ++z) {
      if (z == 0 || lit_.size() > 1) {
        in = legs_to(middle.cell, lit(z), blockers, middle.surface, true);
      }
      if (in.empty()) continue;
      sum.add_lambertian(
          z, scattered, in,
          legs_to(middle.cell, seen_[static_cast<std::size_t>(z)], blockers, middle.surface, true));
    }
  }
}

void StaticBounces::add(const Blockers& bodies, HistogramCube& cube) const {
  if (!any()) return;
  Blockers blockers = bodies;
  blockers.push_back(&setup_.surface_rays());
  PairSum sum(scene_.sensor);
  for (int z = 0; z < scene_.sensor.zone_count(); ++z) add_two(sum, z, blockers);
  add_three(sum, blockers);
  sum.finish(cube);
}

}  // namespace blindcorner
