// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/transport/transport_plan.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "blindcorner/forward/error.h"
#include "forward/relay/visibility.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Above this ratio of the lobe's footprint to the lit spot, pairs replace the single sum of a
/// retroreflector. By judgement: below it, a comparison with pairs (find_sampling) tells how much
/// the sum leaves out at edges, which costs time once.
constexpr double kSingleSumRatio = 0.05;
/// Segments of the polyhedron that stands for a curved body. For the light of the body itself, any
/// number gives the same result: a polyhedron inside a convex body hides nothing from its surface.
constexpr int kBodySegments = 12;

/// Whether a plane separates the convex hulls of two sets of points by more than `margin` m.
/// Gilbert's algorithm on the hulls' difference (SIAM J. Control 4, 1966): the nearest point to the
/// origin found so far is a candidate for the plane's normal. False if no plane was found, which
/// does not prove that there is none.
bool separated(const std::vector<Vector3d>& a, const std::vector<Vector3d>& b, double margin) {
  constexpr int kSteps = 60;  // by judgement: an early end only keeps a face that hides nothing
  const auto farthest = [](const std::vector<Vector3d>& points, const Vector3d& along) {
    return *std::max_element(
        points.begin(), points.end(),
        [&](const Vector3d& p, const Vector3d& q) { return p.dot(along) < q.dot(along); });
  };
  Vector3d nearest = a.front() - b.front();
  for (int i = 0; i < kSteps && nearest.norm() > margin; ++i) {
    const Vector3d support = farthest(a, -nearest) - farthest(b, nearest);
    if (support.dot(nearest) > margin * nearest.norm()) return true;
    const Vector3d step = support - nearest;
    const double t = -nearest.dot(step) / std::max(step.squaredNorm(), 1e-300);
    nearest += std::clamp(t, 0.0, 1.0) * step;
  }
  return false;
}

/// Whether the face cannot stand between any two of the points, because all points lie on one side
/// of its plane or because it lies outside of their hull.
bool cannot_block(const OccluderFace& face, const std::vector<Vector3d>& points, double margin) {
  const auto& c = face.corners;
  const Vector3d normal = face_normal(c);
  double low = 1e300;
  double high = -1e300;
  for (const Vector3d& point : points) {
    const double distance = normal.dot(point - c[0]);
    low = std::min(low, distance);
    high = std::max(high, distance);
  }
  if (low >= -margin || high <= margin) return true;
  return separated({c.begin(), c.end()}, points, margin);
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

double lobe_ratio(const Scene& scene, const std::vector<Vector3d>& relay_points,
                  double lit_extent) {
  const auto* retro = std::get_if<RetroreflectiveMaterial>(&scene.hidden.material);
  if (retro == nullptr || !(lit_extent > 0)) return 0.0;
  double farthest = 0;
  for (int i = 0; i < object_count(scene); ++i) {
    const HiddenObject& object = hidden_object(scene, i);
    for (const Placement& probe : probe_placements(scene, i)) {
      const Vector3d middle = object_to_world(object.shape, object.anchor, probe).translation();
      for (const Vector3d& relay : relay_points) {
        farthest = std::max(farthest, (relay - middle).squaredNorm());
      }
    }
  }
  return retro->lobe_sigma * std::sqrt(farthest) / lit_extent;
}

Kernel kernel_for(const Scene& scene, double ratio, const PlanOverrides& overrides) {
  if (std::holds_alternative<BrdfMaterial>(scene.hidden.material)) return Kernel::brdf_pairs;
  if (!std::holds_alternative<RetroreflectiveMaterial>(scene.hidden.material)) {
    return Kernel::lambertian;
  }
  const bool single = ratio > kSingleSumRatio ? overrides.switched_off(Term::patch_pairs)
                                              : !overrides.switched_on(Term::patch_pairs);
  return single ? Kernel::retro_single : Kernel::retro_pairs;
}

void decide_kernel(TransportPlan& plan, const Scene& scene, double ratio,
                   const PlanOverrides& overrides) {
  plan.kernel = kernel_for(scene, ratio, overrides);
  PlanDecision pairs{Term::patch_pairs, "pairs of lit and seen relay patches", false,
                     "a Lambertian object's light factorises into two sums", 0.0};
  if (plan.kernel == Kernel::brdf_pairs) {
    pairs.used = true;
    pairs.reason = "the BRDF of a " + material_name(scene.hidden.material) +
                   " object depends on both directions";
  } else if (plan.kernel != Kernel::lambertian) {
    pairs.used = ratio > kSingleSumRatio;
    pairs.reason = "the lobe's footprint is at most " + number(ratio) + " of the lit spot" +
                   (pairs.used ? ", above " : ", not above ") + number(kSingleSumRatio);
  }
  plan.decide(pairs);
}

/// Those of the faces that can stand between two of the points.
std::vector<OccluderFace> faces_among(const std::vector<OccluderFace>& faces,
                                      const std::vector<Vector3d>& points) {
  double extent = 0;
  for (const Vector3d& p : points) extent = std::max(extent, (p - points.front()).squaredNorm());
  const double margin = 1e-6 * std::max(std::sqrt(extent), 1e-6);
  std::vector<OccluderFace> among;
  for (const OccluderFace& face : faces) {
    if (!cannot_block(face, points, margin)) among.push_back(face);
  }
  return among;
}

}  // namespace

std::vector<Placement> probe_placements(const Scene& scene, int object) {
  std::vector<Placement> placements{hidden_object(scene, object).placement};
  for (const Unknown& unknown : scene.unknowns) {
    if (unknown.object != object) continue;
    std::vector<Placement> next;
    for (const Placement& placement : placements) {
      for (const double t : {0.0, 0.5, 1.0}) {
        if (t > 0 && unknown.range() == 0) break;  // one value only
        Placement moved = placement;
        moved.set(unknown.component, unknown.lower + t * unknown.range());
        next.push_back(moved);
      }
    }
    placements = std::move(next);
  }
  return placements;
}

std::vector<Vector3d> search_region_corners(const Scene& scene, int index) {
  const HiddenObject& object = hidden_object(scene, index);
  const bool turns = std::ranges::any_of(scene.unknowns, [&](const Unknown& u) {
    return u.object == index && u.component == Component::yaw;
  });
  std::vector<Vector3d> points;
  for (const Placement& probe : probe_placements(scene, index)) {
    const Transform T = object_to_world(object.shape, object.anchor, probe);
    const auto yaw = turns ? std::nullopt : std::optional(probe.yaw);
    const Vector3d half = probe.size * half_extents(object.shape, yaw);
    for (int corner = 0; corner < 8; ++corner) {
      const Vector3d sign((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1,
                          (corner & 4) != 0 ? 1 : -1);
      points.push_back(T.translation() + half.cwiseProduct(sign));
    }
  }
  return points;
}

std::optional<std::vector<Unknown>> ranges_near_relay(const Scene& scene) {
  // Half edge of the part near the relay, in units of the region's distance from the relay. By
  // judgement: light falls with the fourth power of the distance, which leaves a 25th at two
  // distances to the side.
  constexpr double kNear = 2;
  std::vector<Unknown> near = scene.unknowns;
  bool smaller = false;
  for (int object = 0; object < object_count(scene); ++object) {
    const HiddenObject& hidden = hidden_object(scene, object);
    Vector3d low = hidden.placement.position;
    Vector3d high = low;
    const auto moves = [&](const Unknown& u) {
      return u.object == object && u.component <= Component::z;
    };
    for (const Unknown& u : scene.unknowns) {
      if (!moves(u)) continue;
      low[static_cast<int>(u.component)] = u.lower;
      high[static_cast<int>(u.component)] = u.upper;
    }
    double distance = std::numeric_limits<double>::infinity();
    Vector3d nearest = low;
    for (const Surface& surface : scene.surfaces) {
      if (!surface.relay) continue;
      const Vector3d middle = surface.T_world_surface.translation();
      const Vector3d point = middle.cwiseMax(low).cwiseMin(high);
      if ((point - middle).norm() >= distance) continue;
      distance = (point - middle).norm();
      nearest = point;
    }
    if (!std::isfinite(distance)) continue;
    const double reach = kNear * std::max(distance, bounding_radius(hidden.shape, hidden.anchor));
    for (Unknown& u : near) {
      if (!moves(u)) continue;
      const double at = nearest[static_cast<int>(u.component)];
      smaller = smaller || u.range() > 2 * reach;
      u.lower = std::max(u.lower, at - reach);
      u.upper = std::min(u.upper, at + reach);
    }
  }
  return smaller ? std::optional(near) : std::nullopt;
}

bool in_search_region(const Scene& scene, const Placement& placement, int object) {
  for (const Unknown& unknown : scene.unknowns) {
    if (unknown.object != object) continue;
    const double value = placement.get(unknown.component);
    if (unknown.component == Component::yaw) continue;  // a body that turns stays in its own ball
    const double slack = 1e-9 * unknown.range();
    if (!(value >= unknown.lower - slack && value <= unknown.upper + slack)) return false;
  }
  return true;
}

bool PlanOverrides::switched_on(Term term) const { return std::ranges::find(on, term) != on.end(); }

bool PlanOverrides::switched_off(Term term) const {
  return std::ranges::find(off, term) != off.end();
}

const PlanDecision& TransportPlan::decision(Term term) const {
  const auto found = std::ranges::find(decisions, term, &PlanDecision::term);
  if (found == decisions.end())
    throw Error("transport plan", "no decision about the term asked for");
  return *found;
}

void TransportPlan::decide(PlanDecision made) {
  const auto found = std::ranges::find(decisions, made.term, &PlanDecision::term);
  if (found == decisions.end()) {
    decisions.push_back(std::move(made));
  } else {
    *found = std::move(made);
  }
}

std::vector<OccluderFace> body_faces(const Shape& shape, const Transform& T_world_shape,
                                     double size) {
  std::vector<OccluderFace> faces;
  const bool closed = is_closed(shape);
  for (const Triangle& t : triangulate(shape, T_world_shape, size, kBodySegments)) {
    // Triangles at the poles of a round shape have no area.
    const Vector3d u = t[1] - t[0];
    const Vector3d v = t[2] - t[0];
    if (u.cross(v).norm() <= 1e-9 * (u.squaredNorm() + v.squaredNorm())) continue;
    faces.push_back({{t[0], t[1], t[2], 0.5 * (t[2] + t[0])}, closed});
  }
  return faces;
}

void decide_view(TransportPlan& plan, const Scene& scene, const std::vector<Vector3d>& seen) {
  std::vector<Vector3d> region;
  for (int i = 0; i < object_count(scene); ++i) {
    const std::vector<Vector3d> corners = search_region_corners(scene, i);
    region.insert(region.end(), corners.begin(), corners.end());
  }
  const bool apart = separated(seen, region, 0.0);
  plan.decide({Term::object_in_view, "object before the sensor", false,
               apart
                   ? "a plane separates the search region from all that the sensor lights and sees"
                   : "at some poses the object may stand in the light or in the view: that it is "
                     "then seen directly, and shades the relay, is not modelled",
               apart ? 0.0 : std::numeric_limits<double>::infinity()});
}

Kernel choose_kernel(const Scene& scene, const std::vector<Vector3d>& relay_points,
                     double lit_extent, const PlanOverrides& overrides) {
  return kernel_for(scene, lobe_ratio(scene, relay_points, lit_extent), overrides);
}

std::vector<OccluderFace> occluders_between(const Scene& scene,
                                            const std::vector<OccluderFace>& faces,
                                            std::vector<Vector3d> relay_points) {
  if (faces.empty()) return {};
  for (int i = 0; i < object_count(scene); ++i) {
    const std::vector<Vector3d> corners = search_region_corners(scene, i);
    relay_points.insert(relay_points.end(), corners.begin(), corners.end());
  }
  return faces_among(faces, relay_points);
}

TransportPlan make_plan(const Scene& scene, const std::vector<Vector3d>& relay_points,
                        double lit_extent, const PlanOverrides& overrides) {
  TransportPlan plan;
  const auto faces = occluder_faces(scene.surfaces);
  plan.occluders = occluders_between(scene, faces, relay_points);
  const bool used = !plan.occluders.empty();
  const std::string count =
      std::to_string(plan.occluders.size()) + " of " + std::to_string(faces.size());
  plan.decide({Term::occlusion, "occlusion between relay and object", used,
               faces.empty() ? "no surface is marked as an occluder"
               : used        ? count + " occluder faces can stand between relay and search region"
                             : "no occluder face meets the hull of relay and search region"});
  if (overrides.switched_on(Term::occlusion)) plan.occluders = faces;
  if (overrides.switched_off(Term::occlusion)) plan.occluders.clear();
  plan.decide({Term::self_shadowing, "self-shadowing of the object", false,
               "a convex body hides nothing from its own surface"});
  decide_kernel(plan, scene, lobe_ratio(scene, relay_points, lit_extent), overrides);
  const bool spills = !scene.sensor.crosstalk.empty();
  plan.decide({Term::crosstalk, "crosstalk between zones", spills,
               spills ? "the sensor states it" : "the sensor states none"});
  if (scene.sensor.pile_up_cycles > 0) {
    plan.decide(
        {Term::pile_up, "pile-up", true,
         "the sensor records one photon a cycle; captures in which more than 1 % of the light "
         "is hidden are corrected"});
  }
  if (scene.sensor.saturation > 0) {
    plan.decide(
        {Term::saturation, "bins that fill up", true,
         "the sensor states how much a bin holds; a fit leaves out bins that captures fill up"});
  }
  return plan;
}

}  // namespace blindcorner
