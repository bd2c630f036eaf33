// SPDX-License-Identifier: Apache-2.0
#include "inverse/baseline/relay_paths.h"

#include <algorithm>
#include <cmath>

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Patches along each side of the field and of a zone: means and variances of smooth path lengths
/// need no more. Along an evenly lit side, n patches lack 1 / n^2 of the variance: 3 % for the
/// field.
constexpr int kFieldDivisions = 6;
constexpr int kZoneDivisions = 2;

bool has_occluders(const Scene& scene) {
  return std::ranges::any_of(scene.surfaces, [](const Surface& s) { return s.occluder; });
}

RelaySampling sampling_of(int divisions) {
  RelaySampling sampling;
  sampling.divisions = divisions;
  sampling.edge_depth = 1;
  sampling.with_radiance = false;
  return sampling;
}

}  // namespace

RelayPaths::RelayPaths(const Scene& scene, const SensorPlacement& placement)
    : setup_(scene, placement),
      comes_back_(std::holds_alternative<RetroreflectiveMaterial>(scene.hidden.material) ||
                  std::holds_alternative<MeasuredLawMaterial>(scene.hidden.material)),
      shadows_(has_occluders(scene)) {
  const RelaySampling zones = sampling_of(kZoneDivisions);
  const bool confocal = scene.sensor.illumination == Illumination::confocal;
  if (!comes_back_ && !confocal) lit_ = {patches_of(setup_.lit(sampling_of(kFieldDivisions)))};
  for (int z = 0; z < scene.sensor.zone_count(); ++z) {
    const bool dead = scene.sensor.zones[static_cast<std::size_t>(z)].dead;
    seen_.emplace_back();
    if (confocal && !comes_back_) lit_.emplace_back();
    if (dead) continue;
    seen_.back() = comes_back_ ? returning(z, zones) : patches_of(setup_.seen(z, zones));
    if (confocal && !comes_back_) lit_.back() = patches_of(setup_.lit_by_zone(z, zones));
  }
}

std::vector<RelayPaths::Patch> RelayPaths::patches_of(const std::vector<WeightedPatch>& sampled) {
  std::vector<Patch> patches;
  for (const WeightedPatch& w : sampled) {
    patches.push_back({w.patch.center, w.patch.normal, w.leg, w.weight});
  }
  return patches;
}

/// What a zone sees of the lit relay. The leg of each patch is the sum of both outer legs.
std::vector<RelayPaths::Patch> RelayPaths::returning(int zone,
                                                     const RelaySampling& sampling) const {
  RelaySampling with_light = sampling;
  with_light.with_radiance = !setup_.uses_points();
  std::vector<Patch> patches;
  for (const WeightedPatch& w : setup_.seen(zone, with_light)) {
    const double light = with_light.with_radiance ? w.radiance : 1.0;
    if (light <= 0) continue;
    const double way_in = (w.patch.center - setup_.source()).norm();
    patches.push_back({w.patch.center, w.patch.normal, way_in + w.leg, w.weight * light});
  }
  return patches;
}

PointPulse RelayPaths::end(const std::vector<Patch>& patches, const Vector3d& point,
                           bool shadows) const {
  const double passes = comes_back_ ? 2 : 1;
  double sum = 0, first = 0, second = 0;
  for (const Patch& p : patches) {
    const Vector3d way = point - p.center;
    const double r2 = way.squaredNorm();
    const double cosine = way.dot(p.normal);  // times r
    if (cosine <= 0) continue;
    if (shadows && shadows_ && setup_.occluder_rays().blocked(p.center, point)) continue;
    const double r = std::sqrt(r2);
    const double weight = p.weight * cosine / (r2 * r);
    const double path = p.leg + passes * r;
    sum += weight;
    first += weight * path;
    second += weight * path * path;
  }
  if (sum <= 0) return {};
  const double mean = first / sum;
  return {mean, std::max(0.0, second / sum - mean * mean), sum};
}

PointPulse RelayPaths::shared_light(const Vector3d& point, bool shadows) const {
  return lit_.size() == 1 ? end(lit_.front(), point, shadows) : PointPulse{};
}

PointPulse RelayPaths::whole(std::size_t zone, const Vector3d& point, bool shadows,
                             const PointPulse& shared) const {
  PointPulse pulse = end(seen_[zone], point, shadows);
  if (comes_back_) return pulse;
  const PointPulse arriving = lit_.size() > 1 ? end(lit_[zone], point, shadows) : shared;
  pulse.path += arriving.path;
  pulse.variance += arriving.variance;
  pulse.weight *= arriving.weight;
  return pulse;
}

PointPulse RelayPaths::pulse(int zone, const Vector3d& point) const {
  return whole(static_cast<std::size_t>(zone), point, false, shared_light(point, false));
}

void RelayPaths::pulses(const Vector3d& point, bool shadows, std::vector<PointPulse>& out) const {
  const PointPulse shared = shared_light(point, shadows);
  out.clear();
  for (std::size_t z = 0; z < seen_.size(); ++z) out.push_back(whole(z, point, shadows, shared));
}

}  // namespace blindcorner
