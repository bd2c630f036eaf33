// SPDX-License-Identifier: Apache-2.0
/// The three-bounce sum, pair by pair.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <mutex>
#include <optional>
#include <string>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/validate.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "forward/relay/relay_setup.h"
#include "forward/scene/shapes/shape_geometry.h"
#include "forward/transport/measured_law_model.h"
#include "forward/transport/pair_sum.h"
#include "forward/transport/static_background.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Lit cells that meet a lobe are at most this share of its footprint's sigma wide: two Gauss nodes
/// then err by 3 * 0.8^4 / 4320 = 3e-4 of a normal density's peak.
constexpr double kLobeCell = 0.8;
/// Largest product of a cell's share of the light and the fourth power of its path spread (half
/// range over pulse). By judgement: two Gauss nodes err by a 90th of this, which is 1e-3 of a
/// normal density's peak.
constexpr double kPathError = 0.1;
/// Largest edges of the cells of a large object, in units of the pulse's path and of the distance
/// from the relay. The smaller one counts if it is larger than the options' edge. A scene of
/// kilometres then needs no more cells than the same scene of metres. By judgement: two Gauss nodes
/// stand for each edge.
constexpr double kEdgePulses = 3.0;
constexpr double kEdgeDistance = 0.25;
/// Most cells along an object; more would take minutes and gigabytes.
constexpr double kMaxCells = 2000;
/// Steps around a curved body that blocks: its inscribed polygon is then 0.07 % too small in area.
constexpr int kRoundSegments = 96;

/// Sampling of the known scene's later bounces. On the reference floor, the walls, the TMF8828
/// floor and the corridor, their light is within 0.2 to 0.6 % (L2 over photon noise) of that of a
/// denser sampling. Edges are 0.08 to 0.67 of those of the fast model's default sampling
/// (StaticLightSampling), which this one judges, and 0.5 to 0.8 of those of the fast model's
/// finest.
constexpr StaticLightSampling kDenseBounces{.zone_divisions = 2,
                                            .outer_divisions = 3,
                                            .field_divisions = 12,
                                            .patch_angle = 0.25,
                                            .least_patch = 0.7,
                                            .outer_angle = 0.15,
                                            .part_angle = 0.05,
                                            .middle_angle = 0.15,
                                            .middle_edge = 0.025,
                                            .least_middle = 0.004};

/// One of the hidden objects where a pose puts it.
struct PlacedObject {
  const HiddenObject* object;
  Transform T_world_object;
  double size;
};

std::vector<PlacedObject> placed_objects(const Scene& scene, const PoseVector& pose) {
  std::vector<PlacedObject> placed;
  const std::vector<Placement> placements = placements_at(scene, pose);
  for (int i = 0; i < object_count(scene); ++i) {
    const HiddenObject& object = hidden_object(scene, i);
    const Placement& placement = placements[static_cast<std::size_t>(i)];
    placed.push_back(
        {&object, object_to_world(object.shape, object.anchor, placement), placement.size});
  }
  return placed;
}

/// The hidden objects as bodies that block light. A ray that leaves a convex body's own surface
/// outwards does not meet it again, so a body may be asked about its own cells.
std::unique_ptr<RayScene> bodies_of(const std::vector<PlacedObject>& objects) {
  std::vector<std::vector<Triangle>> bodies;
  for (const PlacedObject& o : objects) {
    bodies.push_back(triangulate(o.object->shape, o.T_world_object, o.size, kRoundSegments));
  }
  return std::make_unique<RayScene>(bodies);
}

/// Flat cells become their four Gauss-Legendre nodes.
std::vector<SurfaceCell> gauss_nodes(const std::vector<SurfaceCell>& cells) {
  const double node = 1 / std::sqrt(3.0);
  std::vector<SurfaceCell> nodes;
  nodes.reserve(4 * cells.size());
  for (const SurfaceCell& cell : cells) {
    for (const double a : {-node, node}) {
      for (const double b : {-node, node}) {
        nodes.push_back(cell);
        nodes.back().center += a * cell.half_u + b * cell.half_v;
        nodes.back().area /= 4;
      }
    }
  }
  return nodes;
}

class ReferenceRenderer final : public ForwardModel {
 public:
  ReferenceRenderer(const Scene& scene, const SensorPlacement& placement,
                    const ReferenceOptions& options)
      : scene_(scene),
        options_(options),
        setup_(scene_, placement),
        plan_(make_plan(scene_, setup_.relay_points(), setup_.lit_extent())),
        occluded_(std::any_of(scene_.surfaces.begin(), scene_.surfaces.end(),
                              [](const Surface& s) { return s.occluder; })) {}

  using ForwardModel::three_bounce;
  void three_bounce(const PoseVector& pose, HistogramCube& out) const override;
  const HistogramCube& static_background() const override { return background().light; }
  using ForwardModel::shadowed_background;
  HistogramCube shadowed_background(const PoseVector& pose, bool coarsely) const override;
  const TransportPlan& plan() const override { return plan_; }

 private:
  /// Light of the known scene alone.
  struct StaticBackground {
    PulseTable pulses;
    KnownBounces bounces;  ///< with the usual sampling, which shadows use
    HistogramCube usual;   ///< light of `bounces`
    HistogramCube light;   ///< direct return and bounces, as densely sampled as the options say

    StaticBackground(const Scene& scene, const RelaySetup& setup, const ReferenceOptions& options);
  };
  /// Summed on the first call, because it may take longer than many poses.
  const StaticBackground& background() const;

  using Patches = std::vector<std::vector<WeightedPatch>>;
  /// Lit patches: one list for all zones, or one for each (confocal).
  Patches lit_for(const PlacedObject& object) const;
  Patches seen_for(const PlacedObject& object) const;  ///< [zone]
  Split path_split(const PlacedObject& placed, double all_light) const;
  std::vector<WeightedPatch> split_by_path(
      const std::function<std::vector<WeightedPatch>()>& sample, RelaySampling& sampling,
      const PlacedObject& object) const;
  double longest_edge(const PlacedObject& placed) const;
  std::vector<SurfaceCell> cells_of(const PlacedObject& placed) const;
  void add_object(const PlacedObject& placed, const Blockers& blockers, PairSum& sum) const;

  Scene scene_;
  ReferenceOptions options_;
  RelaySetup setup_;
  TransportPlan plan_;
  bool occluded_;  ///< some surface blocks light
  mutable std::once_flag known_once_;
  mutable std::optional<StaticBackground> known_;
};

/// Divisions of a zone at which the known scene's light has its usual sampling.
constexpr double kUsualDivisions = 4;
/// Path spread of the direct return's cells over the pulse's standard deviation, times the
/// divisions of a zone. The spread is the fast model's at the usual sampling, and less at denser
/// ones.
constexpr double kDirectSpread = 1.2;

ReferenceRenderer::StaticBackground::StaticBackground(const Scene& scene, const RelaySetup& setup,
                                                      const ReferenceOptions& options)
    : pulses(scene.sensor.response, scene.sensor.bin_width,
             std::pow(scene.sensor.response.core_sigma(), 2), kPulseTail),
      bounces(scene, denser(kDenseBounces, options.zone_divisions / kUsualDivisions)),
      usual(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins) {
  const double divisions = options.known_density * options.zone_divisions;
  light = setup.direct_return(pulses, {.divisions = static_cast<int>(std::lround(4 * divisions)),
                                       .spread = kDirectSpread / divisions});
  bounces.add(setup, pulses, usual);
  if (options.known_density == 1) {
    std::ranges::transform(light.values, usual.values, light.values.begin(), std::plus<>());
  } else {
    KnownBounces(scene, denser(kDenseBounces, divisions / kUsualDivisions))
        .add(setup, pulses, light);
  }
  mix_zones(scene.sensor, light);
}

const ReferenceRenderer::StaticBackground& ReferenceRenderer::background() const {
  std::call_once(known_once_, [this] { known_.emplace(scene_, setup_, options_); });
  return *known_;
}

/// Light that a patch exchanges with an object, up to a constant.
double exchanged(const RelayPatch& patch, const Vector3d& object) {
  const Vector3d way = object - patch.center;
  const double cosine = std::max(way.dot(patch.normal) / way.norm(), 0.0);
  return patch.solid_angle * patch.albedo * cosine / way.squaredNorm();
}

/// Half an edge of a relay cell, as seen from the object, in standard deviations of the narrowest
/// lobe of the object's BRDF.
constexpr double kLobeEdge = 0.5;

/// Most cells along an object that a lobe may ask for, by judgement of time.
constexpr double kMaxLobeCells = 300;

/// Narrowest lobe of the object's BRDF, rad; infinite for materials without a BRDF of their own.
double narrowest_lobe(const HiddenObject& object) {
  const auto* material = std::get_if<BrdfMaterial>(&object.material);
  return material != nullptr ? material->brdf->narrowest_lobe()
                             : std::numeric_limits<double>::infinity();
}

/// Divides cells whose paths to the object differ too much for the pulse, such as those of a floor
/// seen at a grazing angle. Two Gauss nodes err by the fourth power of h, half the difference over
/// the pulse's width, so a cell with the share s of the region's light may have h^4 = 0.1 / s. For
/// a BRDF, cells are also divided until the object sees half an edge under at most kLobeEdge.
Split ReferenceRenderer::path_split(const PlacedObject& placed, double all_light) const {
  const double angle = kLobeEdge * narrowest_lobe(*placed.object);
  const Vector3d object = placed.T_world_object.translation();
  const double pulse = kSpeedOfLight * std::hypot(scene_.sensor.response.core_sigma(),
                                                  scene_.sensor.bin_width / std::sqrt(12.0));
  return [object, pulse, all_light, angle, origin = setup_.origin()](const RelayPatch& patch) {
    const Vector3d way = patch.center - object;
    const double half_u = patch.half_u.norm(), half_v = patch.half_v.norm();
    if (std::max(half_u, half_v) > angle * way.norm()) return half_u >= half_v ? 1 : 2;
    const Vector3d gradient = (patch.center - origin).normalized() + way.normalized();
    const double u = std::abs(gradient.dot(patch.half_u)) / pulse;
    const double v = std::abs(gradient.dot(patch.half_v)) / pulse;
    if (std::pow(std::max(u, v), 4) * exchanged(patch, object) <= kPathError * all_light) return 0;
    return u >= v ? 1 : 2;
  };
}

/// Samples evenly to learn the region's light, then again with cells divided by their paths.
std::vector<WeightedPatch> ReferenceRenderer::split_by_path(
    const std::function<std::vector<WeightedPatch>()>& sample, RelaySampling& sampling,
    const PlacedObject& object) const {
  sampling.split = nullptr;
  double all_light = 0;
  const Vector3d place = object.T_world_object.translation();
  for (const WeightedPatch& p : sample()) all_light += exchanged(p.patch, place);
  sampling.split = path_split(object, all_light);
  return sample();
}

/// Number of relay cells along a zone. Where more than eight zones lie along the field, zones are
/// so small that they need fewer cells: as many along the field as eight zones have, but at least
/// two per zone. With 16 x 16 zones, two cells err by 2e-4 of the light (L2; plate, retroreflective
/// cylinder) and four by 9e-5; two take a quarter of the time.
int cells_along_zone(const Sensor& sensor, int zone_divisions) {
  constexpr int kZones = 8, kFewest = 2;
  const int zones = std::max({sensor.rows, sensor.columns, kZones});
  const auto cells = static_cast<int>(std::lround(1.0 * zone_divisions * kZones / zones));
  return std::clamp(cells, std::min(kFewest, zone_divisions), zone_divisions);
}

ReferenceRenderer::Patches ReferenceRenderer::seen_for(const PlacedObject& object) const {
  RelaySampling sampling;
  sampling.divisions = cells_along_zone(scene_.sensor, options_.zone_divisions);
  sampling.nodes = [](const RelayPatch&) { return std::array{2, 2}; };
  Patches seen(scene_.sensor.zones.size());
  for (std::size_t z = 0; z < seen.size(); ++z) {
    if (scene_.sensor.zones[z].dead) continue;
    const auto even = [&] { return setup_.seen(static_cast<int>(z), sampling); };
    seen[z] = split_by_path(even, sampling, object);
  }
  return seen;
}

ReferenceRenderer::Patches ReferenceRenderer::lit_for(const PlacedObject& object) const {
  RelaySampling sampling;
  sampling.divisions = options_.field_divisions;
  if (const auto* retro = std::get_if<RetroreflectiveMaterial>(&object.object->material)) {
    // Lit cells must be small against the lobe's footprint.
    const double sigma = retro->lobe_sigma;
    const Vector3d center = object.T_world_object.translation();
    sampling.split = [center, sigma](const RelayPatch& patch) {
      const double u = patch.half_u.norm();
      const double v = patch.half_v.norm();
      const double most = 0.5 * kLobeCell * sigma * (patch.center - center).norm();
      return std::max(u, v) <= most ? 0 : (u > v ? 1 : 2);
    };
  } else {
    sampling.nodes = [](const RelayPatch&) { return std::array{2, 2}; };
  }
  const bool split = !sampling.split;
  const auto sampled = [&](const auto& sample) {
    return split ? split_by_path(sample, sampling, object) : sample();
  };
  if (scene_.sensor.illumination == Illumination::flash) {
    return {sampled([&] { return setup_.lit(sampling); })};
  }
  Patches lit(scene_.sensor.zones.size());
  for (std::size_t z = 0; z < lit.size(); ++z) {
    if (scene_.sensor.zones[z].dead) continue;
    lit[z] = sampled([&] { return setup_.lit_by_zone(static_cast<int>(z), sampling); });
  }
  return lit;
}

/// Largest edge of the object's cells before the factor `size`, m.
double ReferenceRenderer::longest_edge(const PlacedObject& placed) const {
  const double radius = placed.size * bounding_radius(placed.object->shape, Anchor::center);
  const double pulse = kSpeedOfLight * std::hypot(scene_.sensor.response.core_sigma(),
                                                  scene_.sensor.bin_width / std::sqrt(12.0));
  double distance = std::numeric_limits<double>::infinity();
  for (const Vector3d& point : setup_.relay_points()) {
    distance = std::min(distance, (point - placed.T_world_object.translation()).norm() - radius);
  }
  const double edge = std::max(options_.object_edge * placed.size,
                               std::min(kEdgePulses * pulse, kEdgeDistance * distance));
  if (2 * radius > kMaxCells * edge) {
    throw Error("reference renderer",
                "found an object of " + std::to_string(2 * radius) + " m, accepted: at most " +
                    std::to_string(kMaxCells * edge) + " m at this pulse and distance");
  }
  const double lobe = narrowest_lobe(*placed.object);
  if (std::isinf(lobe)) return edge / placed.size;
  // Over an edge e at the distance r, the direction in which a mirror sends light turns by 2 e / r.
  // The object's nearest part is not the whole object, so a larger distance counts.
  const double middle = std::max(distance, 0.5 * (distance + radius));
  const double for_lobe = kLobeEdge * lobe * middle;
  if (2 * radius > kMaxLobeCells * for_lobe) {
    throw Error("reference renderer",
                "found a lobe of " + std::to_string(lobe) + " rad, accepted: at least " +
                    std::to_string(2 * radius / (kMaxLobeCells * kLobeEdge * middle)) +
                    " rad at this object and distance");
  }
  return std::min(edge, for_lobe) / placed.size;
}

std::vector<SurfaceCell> ReferenceRenderer::cells_of(const PlacedObject& placed) const {
  const Shape& shape = placed.object->shape;
  const bool flat = geometry_of(shape)->parallelogram_cells();
  const int nodes = flat ? 1 : 2;  // single nodes are put as densely as Gauss nodes
  const auto cells = divide(shape, placed.T_world_object, placed.size, longest_edge(placed) / nodes,
                            options_.object_divisions * nodes);
  return flat ? gauss_nodes(cells) : cells;
}

void ReferenceRenderer::add_object(const PlacedObject& placed, const Blockers& blockers,
                                   PairSum& sum) const {
  const HiddenObject& object = *placed.object;
  const auto* retro = std::get_if<RetroreflectiveMaterial>(&object.material);
  const auto* other = std::get_if<BrdfMaterial>(&object.material);
  const Patches lit = lit_for(placed);
  const Patches seen = seen_for(placed);
  for (const SurfaceCell& cell : cells_of(placed)) {
    std::vector<Leg> in;
    for (int z = 0; z < scene_.sensor.zone_count(); ++z) {
      const auto zone = static_cast<std::size_t>(z);
      if (z == 0 || lit.size() > 1) in = legs_to(cell, lit[zone], blockers);
      if (in.empty() || seen[zone].empty()) continue;
      const std::vector<Leg> out = legs_to(cell, seen[zone], blockers);
      if (retro != nullptr) {
        sum.add_retroreflective(z, cell.area, object.albedo, retro->lobe_sigma, in, out);
      } else if (other != nullptr) {
        sum.add_brdf(z, cell.area * object.albedo, *other->brdf, cell.normal, in, out);
      } else {
        sum.add_lambertian(z, cell.area * object.albedo / kPi, in, out);
      }
    }
  }
}

void ReferenceRenderer::three_bounce(const PoseVector& pose, HistogramCube& out) const {
  out = HistogramCube(scene_.sensor.rows, scene_.sensor.columns, scene_.sensor.bins);
  const std::vector<PlacedObject> objects = placed_objects(scene_, pose);
  Blockers blockers;
  if (occluded_) blockers.push_back(&setup_.occluder_rays());
  std::unique_ptr<RayScene> bodies;
  if (objects.size() > 1 || !is_convex(objects.front().object->shape)) {
    bodies = bodies_of(objects);
    blockers.push_back(bodies.get());
  }
  PairSum sum(scene_.sensor);
  for (const PlacedObject& object : objects) add_object(object, blockers, sum);
  sum.finish(out);
  mix_zones(scene_.sensor, out);
}

HistogramCube ReferenceRenderer::shadowed_background(const PoseVector& pose,
                                                     bool /*coarsely*/) const {
  const StaticBackground& known = background();
  if (!known.bounces.any()) return known.light;
  HistogramCube taken(scene_.sensor.rows, scene_.sensor.columns, scene_.sensor.bins);
  known.bounces.add(setup_, known.pulses, taken, hidden_faces(scene_, pose));
  std::ranges::transform(known.usual.values, taken.values, taken.values.begin(), std::minus<>());
  mix_zones(scene_.sensor, taken);
  HistogramCube light = known.light;
  std::ranges::transform(light.values, taken.values, light.values.begin(), std::minus<>());
  return light;
}

}  // namespace

void ReferenceOptions::validate() const {
  if (zone_divisions < 1) throw Error("ReferenceOptions.zone_divisions", "accepted: at least 1");
  if (field_divisions < 1) throw Error("ReferenceOptions.field_divisions", "accepted: at least 1");
  if (object_divisions < 1)
    throw Error("ReferenceOptions.object_divisions", "accepted: at least 1");
  if (!(object_edge > 0)) throw Error("ReferenceOptions.object_edge", "accepted: above 0 m");
  if (!(known_density > 0)) throw Error("ReferenceOptions.known_density", "accepted: above 0");
}

ReferenceOptions reference_sampling(double scale) {
  ReferenceOptions options;
  const auto times = [&](int n) { return std::max(1, static_cast<int>(std::lround(scale * n))); };
  options.zone_divisions = times(options.zone_divisions);
  options.field_divisions = times(options.field_divisions);
  options.object_divisions = times(options.object_divisions);
  options.object_edge /= scale;
  return options;
}

std::unique_ptr<ForwardModel> make_reference_renderer(const Scene& scene,
                                                      const SensorPlacement& placement,
                                                      const ReferenceOptions& options) {
  options.validate();
  validate(scene);
  if (std::holds_alternative<MeasuredLawMaterial>(scene.hidden.material)) {
    return make_measured_law_model(scene, placement, 0.0);
  }
  return std::make_unique<ReferenceRenderer>(scene, placement, options);
}

}  // namespace blindcorner
