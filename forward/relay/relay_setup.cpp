// SPDX-License-Identifier: Apache-2.0
#include "forward/relay/relay_setup.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/validate.h"
#include "forward/support/parallel.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Largest distance of a given relay point from the relay surface to which it is assigned, m.
constexpr double kRelayPointTolerance = 0.5;

/// Number of cells along a side of a zone in which the field ends, and number of points along each
/// side of such a cell that measure its lit share. The reference floor's light is then within 9e-5
/// (L2) of that of cells a quarter as large.
constexpr int kRimDivisions = 64;
constexpr int kRimPoints = 4;

/// Rays to a cell over a border of surfaces. On the crossing, {4, 0.3, 5} errs as little with these
/// as with 34 rays and takes three quarters of the time.
constexpr int kDirectEdgeRays = 13;
/// Inset of a cell's corner rays. With the default 0.02, the edge of a building that lay in the rim
/// of a cell made an error of 9e-4 (L2) on the crossing.
constexpr double kDirectEdgeInset = 1e-3;

/// Spreads that two, three, ... Gauss nodes represent as well as two nodes represent a spread of
/// one. One more node takes half as much work as halving the cell (street: the same error in 0.45
/// of the time).
constexpr std::array<double, 4> kDirectReach = {1, 1.7, 2.4, 3};

/// Number of nodes for a spread.
int direct_nodes(double spread) {
  const auto reach = std::ranges::lower_bound(kDirectReach, spread);
  const auto most = static_cast<int>(kDirectReach.size()) - 1;
  return 2 + std::min(static_cast<int>(reach - kDirectReach.begin()), most);
}

/// Whether the field lights all directions of a zone, if both have the same apex.
bool lies_within(const AngularRectangle& zone, const FieldOfIllumination& field) {
  if (const auto* r = std::get_if<AngularRectangle>(&field)) {
    return zone.left >= r->left && zone.right <= r->right && zone.top >= r->top &&
           zone.bottom <= r->bottom;
  }
  // The field is convex, so that the corners decide.
  for (const double right : {zone.left, zone.right}) {
    for (const double down : {zone.top, zone.bottom}) {
      if (!contains(field, direction_from_tangents(std::tan(right), std::tan(down)))) return false;
    }
  }
  return true;
}

std::vector<Surface> only_occluders(const std::vector<Surface>& surfaces) {
  std::vector<Surface> chosen;
  std::copy_if(surfaces.begin(), surfaces.end(), std::back_inserter(chosen),
               [](const Surface& s) { return s.occluder; });
  return chosen;
}

/// Directions of a zone that is not a relay point.
const AngularRectangle& footprint(const Sensor& sensor, int zone) {
  return std::get<AngularRectangle>(sensor.zones[static_cast<std::size_t>(zone)].footprint);
}

/// Text on a capture's sensor pose that replaces the scene's pose; empty if none does.
std::string pose_of_its_own(const Scene& scene, const SensorPlacement& placement) {
  const Transform& T = placement.T_world_sensor;
  if (T.isApprox(scene.T_world_sensor, 1e-9)) return "";
  char text[200];
  std::snprintf(
      text, sizeof text,
      " from the capture's own sensor pose, at (%.4g, %.4g, %.4g) m, looking along (%.3g, "
      "%.3g, %.3g), which overrides the scene's",
      T(0, 3), T(1, 3), T(2, 3), T(0, 0), T(1, 0), T(2, 0));
  return text;
}

}  // namespace

SensorPlacement sensor_placement(const Scene& scene, const Capture* capture) {
  validate(scene);
  SensorPlacement placement;
  placement.T_world_sensor = scene.T_world_sensor;
  if (capture != nullptr && capture->T_world_sensor) {
    placement.T_world_sensor = *capture->T_world_sensor;
  }
  if (capture != nullptr && capture->relay_points) {
    placement.relay_points = *capture->relay_points;
    return placement;
  }
  const auto& zones = scene.sensor.zones;
  if (!zones.empty() && std::holds_alternative<Vector3d>(zones.front().footprint)) {
    for (const Zone& zone : zones)
      placement.relay_points.push_back(std::get<Vector3d>(zone.footprint));
  }
  return placement;
}

Error measured_law_without_points(const Scene& scene) {
  return {scene_place(scene),
          "hidden.material: found a measured law with zones that have an extent, accepted: zones "
          "that are relay points"};
}

void check_relay_visible(const Scene& scene) {
  const SensorPlacement placement = sensor_placement(scene);
  const bool points = !placement.relay_points.empty();
  const auto law = [](const HiddenObject& object) {
    return std::holds_alternative<MeasuredLawMaterial>(object.material);
  };
  if (!points && (law(scene.hidden) || std::ranges::any_of(scene.further_hidden, law))) {
    throw measured_law_without_points(scene);
  }
  const auto stated = [](const Vector3d& point) { return point.allFinite(); };
  // Without stated points, the captures bring them.
  if (points && !std::ranges::any_of(placement.relay_points, stated)) return;
  RelaySetup(scene, placement).relay_points();
}

SurfaceRays::SurfaceRays(const std::vector<Surface>& surfaces)
    : all(surfaces), occluders(only_occluders(surfaces)) {}

RelaySetup::RelaySetup(const Scene& scene, const SensorPlacement& placement)
    : RelaySetup(scene, placement, std::make_shared<SurfaceRays>(scene.surfaces)) {}

RelaySetup::RelaySetup(const Scene& scene, const SensorPlacement& placement,
                       std::shared_ptr<const SurfaceRays> rays)
    : scene_(scene),
      placement_(placement),
      source_(placement.T_world_sensor * scene.sensor.light_offset),
      detector_(placement.T_world_sensor.translation()),
      rays_(std::move(rays)) {
  if (uses_points()) {
    if (static_cast<int>(placement_.relay_points.size()) != scene_.sensor.zone_count()) {
      throw Error("relay_points_m", "found " + std::to_string(placement_.relay_points.size()) +
                                        " points, accepted: one per zone, " +
                                        std::to_string(scene_.sensor.zone_count()));
    }
    for (int z = 0; z < scene_.sensor.zone_count(); ++z) {
      const auto i = static_cast<std::size_t>(z);
      if (!scene_.sensor.zones[i].dead && !placement_.relay_points[i].allFinite()) {
        throw Error(point_field(z),
                    "found no relay point, accepted: a finite one (from_capture: a capture that "
                    "has it), or a dead zone");
      }
    }
  }
}

const FieldOfIllumination& RelaySetup::field_of_zone(int zone, FieldOfIllumination& storage) const {
  if (scene_.sensor.illumination == Illumination::flash) return scene_.sensor.field;
  const Zone& z = scene_.sensor.zones[static_cast<std::size_t>(zone)];
  storage = std::get<AngularRectangle>(z.footprint);
  return storage;
}

std::vector<WeightedPatch> RelaySetup::region(const Vector3d& origin,
                                              const FieldOfIllumination& field,
                                              const RelaySampling& sampling,
                                              bool relay_only) const {
  const std::vector<RelayPatch> sampled = sample_region(
      rays_->all, scene_.surfaces, origin, placement_.T_world_sensor.linear(), field, sampling);
  std::vector<WeightedPatch> patches;
  patches.reserve(sampled.size());
  for (const RelayPatch& patch : sampled) {
    if (patch.albedo <= 0) continue;
    if (relay_only && !scene_.surfaces[static_cast<std::size_t>(patch.surface)].relay) continue;
    WeightedPatch& weighted = patches.emplace_back();
    weighted.patch = patch;
    weighted.weight = patch.solid_angle * patch.albedo / kPi;
    weighted.leg = patch.distance;
    weighted.leg_direction = (patch.center - origin) / patch.distance;
  }
  return patches;
}

std::string RelaySetup::point_field(int zone) const {
  const auto z = static_cast<std::size_t>(zone);
  const std::string index = "[" + std::to_string(zone) + "]";
  const auto* own = std::get_if<Vector3d>(&scene_.sensor.zones[z].footprint);
  const Vector3d& point = placement_.relay_points[z];
  if (point.allFinite() && !(own != nullptr && *own == point)) return "relay_points_m" + index;
  return scene_place(scene_) + ": sensor.zones" + index;
}

WeightedPatch RelaySetup::point_patch(int zone) const {
  const Vector3d& point = placement_.relay_points[static_cast<std::size_t>(zone)];
  WeightedPatch weighted;
  try {
    weighted.patch = relay_point_patch(scene_.surfaces, point, kRelayPointTolerance);
  } catch (const Error& error) {
    throw Error(point_field(zone), error.what());
  }
  weighted.weight = weighted.patch.albedo / kPi;
  weighted.leg = (point - detector_).norm();
  weighted.leg_direction = (point - detector_) / weighted.leg;
  return weighted;
}

void RelaySetup::take_off_direct_path(std::vector<WeightedPatch>& seen) const {
  if (scene_.sensor.path_origin == PathOrigin::sensor) return;
  for (WeightedPatch& p : seen) {
    p.leg = -p.leg;
    p.leg_direction = -p.leg_direction;
  }
}

std::vector<WeightedPatch> RelaySetup::lit(const RelaySampling& sampling, bool relay_only) const {
  std::vector<WeightedPatch> patches;
  if (uses_points()) {
    for (int z = 0; z < scene_.sensor.zone_count(); ++z) {
      // A zone with a dead detector still marks a lit spot.
      if (!placement_.relay_points[static_cast<std::size_t>(z)].allFinite()) continue;
      patches.push_back(point_patch(z));
      patches.back().patch.group = z;
    }
  } else {
    patches = region(source_, scene_.sensor.field, sampling, relay_only);
  }
  for (WeightedPatch& patch : patches) patch.weight *= scene_.sensor.radiant_intensity;
  return patches;
}

std::vector<WeightedPatch> RelaySetup::seen(int zone, const RelaySampling& sampling,
                                            bool relay_only) const {
  std::vector<WeightedPatch> patches;
  if (uses_points()) {
    patches = {point_patch(zone)};
  } else {
    patches = region(detector_, footprint(scene_.sensor, zone), sampling, relay_only);
  }
  if (sampling.with_radiance) {
    for (WeightedPatch& patch : patches) patch.radiance = radiance(zone, patch.patch);
  }
  take_off_direct_path(patches);
  return patches;
}

double RelaySetup::reflected_solid_angle(int zone) const {
  if (uses_points()) return 0;
  RelaySampling sampling;
  sampling.divisions = 8;
  double sum = 0;
  for (const WeightedPatch& patch :
       region(detector_, footprint(scene_.sensor, zone), sampling, false)) {
    sum += patch.weight;
  }
  return sum;
}

std::vector<WeightedPatch> RelaySetup::lit_by_zone(int zone, const RelaySampling& sampling,
                                                   bool relay_only) const {
  std::vector<WeightedPatch> patches;
  if (uses_points()) {
    patches = {point_patch(zone)};
  } else {
    patches = region(source_, footprint(scene_.sensor, zone), sampling, relay_only);
  }
  for (WeightedPatch& patch : patches) patch.weight *= scene_.sensor.radiant_intensity;
  return patches;
}

/// Whether the field ends within the patch.
bool RelaySetup::on_rim(const RelayPatch& patch, const FieldOfIllumination& field) const {
  const Eigen::Matrix3d to_sensor = placement_.T_world_sensor.linear().transpose();
  int lit = 0;
  for (const double a : {-1.0, 1.0}) {
    for (const double b : {-1.0, 1.0}) {
      const Vector3d corner = patch.area_center + a * patch.half_u + b * patch.half_v;
      if (contains(field, to_sensor * (corner - source_))) ++lit;
    }
  }
  const bool middle = contains(field, to_sensor * (patch.area_center - source_));
  return lit != (middle ? 4 : 0);
}

double RelaySetup::radiance(int zone, const RelayPatch& patch) const {
  if (uses_points()) return patch.albedo / kPi;
  FieldOfIllumination storage;
  return radiance(patch, field_of_zone(zone, storage), nullptr);
}

double RelaySetup::radiance(const RelayPatch& patch, const FieldOfIllumination& field, double* leg,
                            int rim_points) const {
  const Eigen::Matrix3d to_sensor = placement_.T_world_sensor.linear().transpose();
  const auto lit = [&](double a, double b) {
    return contains(
        field, to_sensor * (patch.area_center + a * patch.half_u + b * patch.half_v - source_));
  };
  double fraction = lit(0, 0) ? 1 : 0;
  if (on_rim(patch, field)) {
    int count = 0;
    for (int i = 0; i < rim_points; ++i) {
      for (int j = 0; j < rim_points; ++j) {
        if (lit((2 * i + 1.0) / rim_points - 1, (2 * j + 1.0) / rim_points - 1)) ++count;
      }
    }
    fraction = static_cast<double>(count) / (rim_points * rim_points);
  }
  const Vector3d way = patch.center - source_;
  const double distance = way.norm();
  if (leg != nullptr) *leg = distance;
  if (fraction == 0) return 0;
  const double cosine = -way.dot(patch.normal) / distance;
  if (cosine <= 0) return 0;
  if ((source_ - detector_).norm() > 1e-9 && rays_->all.blocked(source_, patch.center)) return 0;
  return fraction * scene_.sensor.radiant_intensity * cosine / (distance * distance) *
         patch.albedo / kPi;
}

HistogramCube RelaySetup::direct_return(const PulseTable& pulses,
                                        const DirectSampling& cells) const {
  const Sensor& sensor = scene_.sensor;
  HistogramCube cube(sensor.rows, sensor.columns, sensor.bins);
  if (sensor.path_origin == PathOrigin::relay || uses_points()) return cube;
  RelaySampling sampling;
  sampling.divisions = cells.divisions;
  sampling.edge_depth = cells.edge_depth;
  sampling.edge_rays = kDirectEdgeRays;
  sampling.edge_inset = kDirectEdgeInset;
  sampling.halves_inherit = true;
  // The path difference between neighbouring nodes must lie well within the pulse. Otherwise the
  // light of a grazing floor becomes a comb.
  const double most = cells.spread * kSpeedOfLight *
                      std::hypot(sensor.response.core_sigma(), sensor.bin_width / std::sqrt(12.0));
  const double bins_per_metre = 1 / (kSpeedOfLight * sensor.bin_width);
  const bool monostatic = (source_ - detector_).norm() < 1e-9;
  const auto add_zone = [&](int z) {
    const Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
    std::vector<double> row(static_cast<std::size_t>(unwrapped_bins(sensor)));
    FieldOfIllumination storage;
    const FieldOfIllumination& field = field_of_zone(z, storage);
    const auto& footprint = std::get<AngularRectangle>(zone.footprint);
    const bool lights_all = lies_within(footprint, field);
    const double rim = (footprint.right - footprint.left) / kRimDivisions;
    // Spread of the path along either edge, in units of the spread that two nodes may represent.
    const auto spreads = [&](const RelayPatch& patch) {
      const Vector3d gradient = 2 * (patch.center - detector_) / patch.distance;
      return std::array{std::abs(gradient.dot(patch.half_u)) / (std::sqrt(3.0) * most),
                        std::abs(gradient.dot(patch.half_v)) / (std::sqrt(3.0) * most)};
    };
    RelaySampling own = sampling;
    own.nodes = [&](const RelayPatch& patch) {
      const auto [u, v] = spreads(patch);
      return std::array{direct_nodes(u), direct_nodes(v)};
    };
    own.node_extents = !lights_all;  // needed to test the field's rim
    own.split = [&](const RelayPatch& patch) {
      const auto [u, v] = spreads(patch);
      if (std::max(u, v) > kDirectReach.back()) return u >= v ? 1 : 2;
      if (lights_all) return 0;
      // The light steps at the field's rim, so that cells on it are halved.
      const double wide = patch.half_u.norm(), high = patch.half_v.norm();
      if (2 * std::max(wide, high) <= rim * patch.distance || !on_rim(patch, field)) return 0;
      return wide >= high ? 1 : 2;
    };
    for (const WeightedPatch& seen : region(detector_, footprint, own, false)) {
      double leg = 0;
      double sent = 0;
      if (monostatic && lights_all) {
        leg = seen.leg;
        const double cosine = std::max(-seen.leg_direction.dot(seen.patch.normal), 0.0);
        sent = sensor.radiant_intensity * cosine / (leg * leg) * seen.patch.albedo / kPi;
      } else {
        sent = radiance(seen.patch, field, &leg, kRimPoints);
      }
      if (sent <= 0) continue;
      const Vector3d gradient = seen.leg_direction + (seen.patch.center - source_) / leg;
      const double spread = seen.patch.node ? 0.0
                                            : (std::pow(gradient.dot(seen.patch.half_u), 2) +
                                               std::pow(gradient.dot(seen.patch.half_v), 2)) /
                                                  3;
      pulses.add(row.data(), static_cast<int>(row.size()),
                 zone.time_zero / sensor.bin_width + (seen.leg + leg) * bins_per_metre,
                 spread / (kSpeedOfLight * kSpeedOfLight), sent * seen.patch.solid_angle);
    }
    fold(sensor, z, row.data(), static_cast<int>(row.size()), cube.zone(z));
  };
  parallel_for(0, sensor.zone_count(), add_zone);
  return cube;
}

std::vector<Vector3d> RelaySetup::relay_points() const {
  std::vector<Vector3d> points;
  RelaySampling coarse;
  coarse.divisions = 4;
  coarse.edge_depth = 2;
  const auto add = [&](const std::vector<WeightedPatch>& patches) {
    for (const WeightedPatch& p : patches) {
      for (const double a : {-1.0, 1.0}) {
        for (const double b : {-1.0, 1.0}) {
          points.push_back(p.patch.center + a * p.patch.half_u + b * p.patch.half_v);
        }
      }
    }
  };
  const bool flash = scene_.sensor.illumination == Illumination::flash;
  if (flash) add(lit(coarse));
  const bool any_lit = !flash || !points.empty();
  bool any_seen = false;
  for (int z = 0; z < scene_.sensor.zone_count(); ++z) {
    if (scene_.sensor.zones[static_cast<std::size_t>(z)].dead) continue;
    const auto patches = seen(z, coarse);
    any_seen = any_seen || !patches.empty();
    add(patches);
  }
  if (std::ranges::all_of(scene_.sensor.zones, &Zone::dead)) {
    throw Error(scene_place(scene_),
                "sensor.dead_zones: found every zone, accepted: at least one that works");
  }
  if (!any_lit || !any_seen) {
    throw Error(scene_place(scene_),
                std::string("surfaces: found no relay surface that the sensor ") +
                    (any_seen ? "lights" : "sees") + pose_of_its_own(scene_, placement_) +
                    ", accepted: a relay in view of the sensor, its reflecting side towards it");
  }
  return points;
}

std::vector<Vector3d> RelaySetup::view_hull() const {
  std::vector<Vector3d> points{source_, detector_};
  if (uses_points()) {
    for (const Vector3d& p : placement_.relay_points) {
      if (p.allFinite()) points.push_back(p);
    }
    return points;
  }
  RelaySampling fine;
  fine.divisions = 16;
  fine.edge_depth = 2;
  const Eigen::Matrix3d rotation = placement_.T_world_sensor.linear();
  const auto add = [&](const Vector3d& apex, const FieldOfIllumination& field) {
    double depth = 0;
    for (const WeightedPatch& p : region(apex, field, fine, false)) {
      depth = std::max(depth, rotation.col(0).dot(p.patch.center - apex));
    }
    // A cone lies within the pyramid around it.
    AngularRectangle r;
    if (const auto* cone = std::get_if<AngularCone>(&field)) {
      r = {-cone->half_angle, cone->half_angle, -cone->half_angle, cone->half_angle};
    } else {
      r = std::get<AngularRectangle>(field);
    }
    for (const double right : {std::tan(r.left), std::tan(r.right)}) {
      for (const double down : {std::tan(r.top), std::tan(r.bottom)}) {
        points.push_back(apex + depth * (rotation * Vector3d(1, -right, -down)));
      }
    }
  };
  if (scene_.sensor.illumination == Illumination::flash) add(source_, scene_.sensor.field);
  for (const Zone& zone : scene_.sensor.zones) {
    if (!zone.dead) add(detector_, std::get<AngularRectangle>(zone.footprint));
  }
  return points;
}

double RelaySetup::lit_extent() const {
  RelaySampling coarse;
  coarse.divisions = 4;
  coarse.edge_depth = 2;
  std::vector<WeightedPatch> patches;
  if (scene_.sensor.illumination == Illumination::flash) {
    patches = lit(coarse);
  } else {
    for (int z = 0; z < scene_.sensor.zone_count() && patches.empty(); ++z) {
      if (!scene_.sensor.zones[static_cast<std::size_t>(z)].dead) patches = lit_by_zone(z, coarse);
    }
  }
  double extent = 0;
  for (const WeightedPatch& p : patches) {
    for (const WeightedPatch& q : patches) {
      extent = std::max(extent, (p.patch.center - q.patch.center).norm());
    }
  }
  return extent;
}

int unwrapped_bins(const Sensor& sensor) {
  int most = sensor.wrap_bins;
  for (const Zone& zone : sensor.zones) most = std::max(most, zone.wrap_bins);
  return most > 0 ? sensor.bins + 2 * most : sensor.bins;
}

void mix_zones(const Sensor& sensor, HistogramCube& cube) {
  if (sensor.crosstalk.empty()) return;
  const HistogramCube own = cube;
  std::fill(cube.values.begin(), cube.values.end(), 0.0);
  const auto zones = static_cast<std::size_t>(cube.zones());
  for (std::size_t to = 0; to < zones; ++to) {
    if (sensor.zones[to].dead) continue;
    double* row = cube.zone(static_cast<int>(to));
    for (std::size_t from = 0; from < zones; ++from) {
      const double share = sensor.crosstalk[to * zones + from];
      if (share <= 0) continue;
      const double later =
          (sensor.zones[to].time_zero - sensor.zones[from].time_zero) / sensor.bin_width;
      const int whole = static_cast<int>(std::floor(later));
      const double part = later - whole;
      const double* light = own.zone(static_cast<int>(from));
      for (int k = 0; k < cube.bins; ++k) {
        const int at = k + whole;
        if (at >= 0 && at < cube.bins) row[at] += share * (1 - part) * light[k];
        if (part > 0 && at + 1 >= 0 && at + 1 < cube.bins) row[at + 1] += share * part * light[k];
      }
    }
  }
}

void fold(const Sensor& sensor, int zone, const double* unwrapped, int unwrapped_count,
          double* row) {
  const int wrap = sensor.wrap(zone);
  for (int k = 0; k < unwrapped_count; ++k) {
    const int bin = wrap > 0 ? k % wrap : k;
    if (bin < sensor.bins) row[bin] += unwrapped[k];
  }
}

}  // namespace blindcorner
