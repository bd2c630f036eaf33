// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/coarse_model.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/transport/transport_plan.h"
#include "forward/relay/moving_bodies.h"
#include "forward/relay/visibility.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Widest pulse, in standard deviations of the sensor's own; wider pulses are cut to this width. By
/// judgement: light this wide spreads over so many bins that it decides little.
constexpr double kWidest = 8;
/// Edge of an object's cells in standard deviations of the pulse's path. By judgement: a Gaussian
/// misses 4 % (L2) of even light whose paths range over a third of such an edge. It misses 30 % for
/// an edge seen end on, whose paths range over twice the edge.
constexpr double kObjectEdge = 9;
/// Most cells of an object; with more, the cells become larger or are merged. By judgement: it
/// limits the time, and allows two cells for each side of a box.
constexpr std::size_t kMaxCells = 12;
/// One pulse may stand for a zone's patches up to this standard deviation of their paths both ways,
/// in standard deviations of the pulse's path. By judgement.
constexpr double kRunSpread = 3;
/// Ratio of a lobe's footprint to the lit spot above which light comes back from elsewhere; the
/// same as kSingleSumRatio in transport_plan.cpp.
constexpr double kWideLobe = 0.05;
/// Cells along each side of a zone and of the field of illumination, by judgement: n cells lack
/// 1 / n^2 of the variance of an evenly lit side, which is 6 % for the field.
constexpr int kZoneDivisions = 2;
constexpr int kFieldDivisions = 4;

double pulse_sigma(const Sensor& sensor) {
  return std::hypot(sensor.response.core_sigma(), sensor.bin_width / std::sqrt(12.0));
}

/// One cell in place of cells that face the same way, with the moments of their positions.
SurfaceCell merged(const std::vector<SurfaceCell>& cells) {
  SurfaceCell sum{Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero(), 0};
  for (const SurfaceCell& c : cells) {
    sum.center += c.area * c.center;
    sum.normal += c.area * c.normal;
    sum.area += c.area;
  }
  sum.center /= sum.area;
  // Cells that face aside send less light, so the projected area counts.
  sum.area = sum.normal.norm();
  sum.normal.normalize();
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  double area = 0;
  for (const SurfaceCell& c : cells) {
    const Vector3d d = c.center - sum.center;
    spread += c.area * (d * d.transpose() +
                        (c.half_u * c.half_u.transpose() + c.half_v * c.half_v.transpose()) / 3);
    area += c.area;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(3 * spread / area);
  sum.half_u = std::sqrt(std::max(axes.eigenvalues()[2], 0.0)) * axes.eigenvectors().col(2);
  sum.half_v = std::sqrt(std::max(axes.eigenvalues()[1], 0.0)) * axes.eigenvectors().col(1);
  return sum;
}

/// Cells of a shape no larger than `edge`. If there are too many, the cells become larger, and in
/// the end there is one for each of the 26 directions that cells face.
std::vector<SurfaceCell> cells_of(const Shape& shape, double edge) {
  const Transform here = Transform::Identity();
  std::vector<SurfaceCell> cells;
  for (int doubling = 0; doubling < 4; ++doubling, edge *= 2) {
    cells = divide(shape, here, 1.0, edge, 1);
    if (cells.size() <= kMaxCells) return cells;
  }
  std::vector<std::vector<SurfaceCell>> facing(27);
  for (const SurfaceCell& c : cells) {
    const Vector3d n = c.normal / c.normal.cwiseAbs().maxCoeff();
    std::size_t key = 0;
    for (int i = 0; i < 3; ++i) key = 3 * key + static_cast<std::size_t>(std::lround(n[i]) + 1);
    facing[key].push_back(c);
  }
  cells.clear();
  for (const auto& group : facing) {
    if (!group.empty()) cells.push_back(merged(group));
  }
  return cells;
}

SurfaceCell placed(const SurfaceCell& own, const Transform& T, double size) {
  const Eigen::Matrix3d turn = T.linear();
  return {T * Vector3d(size * own.center), turn * own.normal, size * (turn * own.half_u),
          size * (turn * own.half_v), size * size * own.area};
}

}  // namespace

CoarseScene::CoarseScene(const Scene& scene_)
    : scene(scene_),
      pulse_path(kSpeedOfLight * pulse_sigma(scene_.sensor)),
      pulses(scene_.sensor.response, scene_.sensor.bin_width,
             std::pow(kWidest * pulse_sigma(scene_.sensor), 2), 1e-3),
      occluders(occluder_faces(scene_.surfaces)) {
  for (int i = 0; i < object_count(scene); ++i) {
    const HiddenObject& hidden = hidden_object(scene, i);
    Object object;
    object.cells = cells_of(hidden.shape, kObjectEdge * pulse_path);
    if (const auto* retro = std::get_if<RetroreflectiveMaterial>(&hidden.material)) {
      object.lobe_sigma = retro->lobe_sigma;
    }
    if (const auto* other = std::get_if<BrdfMaterial>(&hidden.material)) object.brdf = other->brdf;
    objects.push_back(std::move(object));
  }
}

CoarseModel::CoarseModel(std::shared_ptr<const CoarseScene> shared,
                         const SensorPlacement& placement)
    : shared_(std::move(shared)),
      confocal_(shared_->scene.sensor.illumination == Illumination::confocal),
      way_in_(shared_->scene.sensor.path_origin == PathOrigin::sensor ? 1.0 : 0.0) {
  static std::atomic<std::uint64_t> made{0};
  id_ = ++made;
  const Scene& scene = shared_->scene;
  const RelaySetup setup(scene, placement);
  const int zones = scene.sensor.zone_count();
  RelaySampling sampling;
  sampling.edge_depth = 1;
  sampling.divisions = kZoneDivisions;
  const auto patches_of = [&](int zone, bool lit) {
    if (scene.sensor.zones[static_cast<std::size_t>(zone)].dead) {
      return std::vector<WeightedPatch>{};
    }
    return lit ? setup.lit_by_zone(zone, sampling) : setup.seen(zone, sampling);
  };
  for (int z = 0; z < zones; ++z) seen_.append(patches_of(z, false), z);
  seen_.finish();
  seen_runs_ = seen_runs(kRunSpread * shared_->pulse_path);

  const double extent = setup.lit_extent();
  const std::vector<Vector3d> relay = setup.relay_points();
  bool wide = false;
  for (int i = 0; i < object_count(scene); ++i) {
    double farthest = 0;
    for (const Placement& probe : probe_placements(scene, i)) {
      for (const Vector3d& r : relay) farthest = std::max(farthest, (r - probe.position).norm());
    }
    const double lobe = shared_->objects[static_cast<std::size_t>(i)].lobe_sigma;
    // A spot without an extent gets its light back, however wide the lobe is.
    const bool wide_lobe = lobe > 0 && extent > 0 && lobe * farthest > kWideLobe * extent;
    wide = wide || wide_lobe || shared_->objects[static_cast<std::size_t>(i)].brdf != nullptr;
    pairs_.push_back(lobe <= 0 || wide_lobe);
  }
  if (std::ranges::none_of(pairs_, [](bool p) { return p; })) return;
  if (confocal_) {
    for (int z = 0; z < zones; ++z) {
      const int begin = lit_.size();
      lit_.append(patches_of(z, true), z);
      if (begin < lit_.size()) lit_runs_.push_back({begin, lit_.size(), z});
    }
  } else {
    sampling.divisions = kFieldDivisions;
    std::vector<WeightedPatch> patches = setup.lit(sampling);
    // Groups are parts of the field with similar paths: quadrants, or single patches for a lobe.
    const Transform to_sensor = placement.T_world_sensor.inverse();
    for (std::size_t i = 0; i < patches.size(); ++i) {
      const Vector3d d = to_sensor * patches[i].patch.center;
      patches[i].patch.group =
          wide ? static_cast<int>(i) : (d.y() < 0 ? 1 : 0) + (d.z() < 0 ? 2 : 0);
    }
    std::ranges::stable_sort(patches, {}, [](const auto& p) { return p.patch.group; });
    lit_.append(patches, -1);
    for (int begin = 0; const int end : lit_.group_end) {
      lit_runs_.push_back({begin, end, -1});
      begin = end;
    }
  }
  lit_.finish();
}

/// Runs of whole zones, or of single patches if a zone's paths differ too much.
std::vector<CoarseModel::Run> CoarseModel::seen_runs(double most_spread) const {
  std::vector<Run> runs;
  const std::vector<Placement> probes = probe_placements(shared_->scene);
  for (std::size_t z = 0; z < seen_.set_end.size(); ++z) {
    const auto [first_patch, last_patch] = seen_.set(z);
    const int begin = static_cast<int>(first_patch), end = static_cast<int>(last_patch);
    const double n = std::max(end - begin, 1);
    double variance = 0;
    for (const Placement& probe : probes) {
      double first = 0, second = 0;
      for (int i = begin; i < end; ++i) {
        const double path =
            seen_.leg[static_cast<std::size_t>(i)] + (seen_.center(i) - probe.position).norm();
        first += path / n;
        second += path * path / n;
      }
      variance = std::max(variance, second - first * first);
    }
    const bool together = 4 * variance < most_spread * most_spread;  // both ways
    const int step = together ? std::max(end - begin, 1) : 1;
    for (int i = begin; i < end; i += step) runs.push_back({i, i + step, static_cast<int>(z)});
  }
  return runs;
}

/// Views the runs of patches from a point, without the parts in shadow. With `comes_back`, the
/// patches' radiance counts.
void CoarseModel::see(const Vector3d& middle, const std::vector<OccluderFace>& occluders,
                      const PatchArrays& patches, const std::vector<Run>& runs, bool comes_back,
                      std::vector<End>& ends) const {
  using Sight = ShadowView::Sight;
  thread_local std::vector<Sight> sights;
  sights.assign(static_cast<std::size_t>(patches.size()) + PatchArrays::kBlock, Sight::clear);
  std::optional<ShadowView> shadows;
  if (!occluders.empty()) {
    shadows.emplace(occluders, middle);
    shadows->leave_out_clear_of(patches.center_of_all, patches.radius_of_all);
    if (shadows->empty()) shadows.reset();
  }
  for (const PatchArrays::Block& block : patches.blocks) {
    if (!shadows) break;
    Sight* own = sights.data() + block.begin;
    const Sight all = shadows->sight(block.center, block.radius);
    if (all == Sight::mixed) {
      shadows->sights(patches.coordinates(), block.begin, block.end, own);
    } else {
      std::fill(own, own + (block.end - block.begin), all);
    }
  }
  ends.assign(runs.size(), {});
  for (std::size_t r = 0; r < runs.size(); ++r) {
    End& end = ends[r];
    double square = 0;
    for (int i = runs[r].begin; i < runs[r].end; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (sights[k] == Sight::hidden) continue;
      VisiblePart part;
      if (sights[k] == Sight::mixed) {
        part = shadows->see(patches.area_center(i), patches.half_u(i), patches.half_v(i));
        if (part.fraction <= 0) continue;
      }
      const Vector3d way = patches.center(i) + part.shift - middle;
      const double distance = way.norm();
      const Vector3d direction = way / distance;
      const double cosine = std::max(-direction.dot(patches.normal(i)), 0.0);
      const double weight = part.fraction * patches.weight[k] * cosine / (distance * distance) *
                            (comes_back ? patches.radiance[k] : 1.0);
      const double leg = patches.leg[k] + patches.leg_direction(i).dot(part.shift);
      const Vector3d gradient = direction + patches.leg_direction(i);
      const Vector3d u = part.fraction * patches.half_u(i), v = part.fraction * patches.half_v(i);
      end.weight += weight;
      end.leg += weight * leg;
      end.distance += weight * distance;
      end.direction += weight * direction;
      square += weight *
                (std::pow(leg + distance, 2) +
                 patches.spread[k] * (std::pow(gradient.dot(u), 2) + std::pow(gradient.dot(v), 2)));
      end.angle2 += weight *
                    (u.squaredNorm() - std::pow(u.dot(direction), 2) + v.squaredNorm() -
                     std::pow(v.dot(direction), 2)) /
                    (6 * distance * distance);
    }
    if (!(end.weight > 0)) continue;
    end.leg /= end.weight;
    end.distance /= end.weight;
    end.angle2 /= end.weight;
    end.variance = std::max(square / end.weight - std::pow(end.leg + end.distance, 2), 0.0);
    const double length = end.direction.norm() / end.weight;  // below 1 if directions differ
    end.angle2 += std::max(1 - length, 0.0);
    end.direction.normalize();
  }
}

void CoarseModel::add(int zone, double path, double variance, double weight, double extra,
                      SparseLight& out) const {
  const Sensor& sensor = shared_->scene.sensor;
  const double position =
      (sensor.zones[static_cast<std::size_t>(zone)].time_zero + path / kSpeedOfLight) /
      sensor.bin_width;
  const double blur = variance / (kSpeedOfLight * kSpeedOfLight) + extra;
  const PulseTable& pulses = shared_->pulses;
  SparseLight::Range& lit = out.lit[static_cast<std::size_t>(zone)];
  if (sensor.wrap(zone) > 0) {
    std::vector<double> unfolded(static_cast<std::size_t>(unwrapped_bins(sensor)));
    const int count = static_cast<int>(unfolded.size());
    pulses.add(unfolded.data(), count, position, blur, weight);
    fold(sensor, zone, unfolded.data(), count, out.cube.zone(zone));
    lit = {0, sensor.bins};
    return;
  }
  const auto [first, last] = pulses.reach(position);
  const int begin = std::max(first, 0), end = std::min(last, sensor.bins);
  if (begin >= end) return;
  pulses.add(out.cube.zone(zone), sensor.bins, position, blur, weight);
  if (lit.begin == lit.end) lit = {begin, end};
  lit = {std::min(lit.begin, begin), std::max(lit.end, end)};
}

/// Adds the light of one piece of an object. The piece's view is a correction of the view from the
/// object's middle.
void CoarseModel::render(const SurfaceCell& cell, const Vector3d& middle, const View& view,
                         std::size_t object, double extra, SparseLight& out) const {
  struct Seen {
    double weight = 0;  ///< 0 behind the piece's horizon
    double path = 0, cosine = 0;
  };
  const Vector3d offset = cell.center - middle;
  const auto from_cell = [&](const End& end) -> Seen {
    if (!(end.weight > 0)) return {};
    const Vector3d way = end.distance * end.direction - offset;
    const double distance = way.norm();
    const double cosine = way.dot(cell.normal) / distance;
    if (cosine <= 0) return {};
    return {end.weight * std::pow(end.distance / distance, 2), end.leg + distance, cosine};
  };
  const auto own_variance = [&](const Vector3d& gradient) {
    return (std::pow(gradient.dot(cell.half_u), 2) + std::pow(gradient.dot(cell.half_v), 2)) / 3;
  };
  const double lobe = shared_->objects[object].lobe_sigma;
  const Brdf* brdf = shared_->objects[object].brdf.get();
  const double scale = hidden_object(shared_->scene, static_cast<int>(object)).albedo * cell.area;
  if (!pairs_[object]) {
    for (std::size_t r = 0; r < seen_runs_.size(); ++r) {
      const End& end = view.seen[r];
      const Seen seen = from_cell(end);
      if (seen.weight <= 0) continue;
      // f is proportional to 1 / cos, so one of two cosines remains. Both legs vary alike.
      const double inner = seen.path - end.leg;
      const double blur = std::pow(lobe * inner, 2) * (2 + 2 * way_in_);
      add(seen_runs_[r].zone, 2 * (way_in_ * end.leg + inner),
          4 * end.variance + blur + own_variance(2 * end.direction),
          scale * seen.weight * seen.cosine, extra, out);
    }
    return;
  }
  thread_local std::vector<Seen> arriving;
  arriving.clear();
  for (const End& end : view.lit) arriving.push_back(from_cell(end));
  for (std::size_t r = 0; r < seen_runs_.size(); ++r) {
    const End& leaving = view.seen[r];
    const Seen seen = from_cell(leaving);
    if (seen.weight <= 0) continue;
    for (std::size_t p = 0; p < lit_runs_.size(); ++p) {
      if (arriving[p].weight <= 0 || (confocal_ && lit_runs_[p].zone != seen_runs_[r].zone)) {
        continue;
      }
      const End& in = view.lit[p];
      double weight = scale * seen.weight * arriving[p].weight;
      if (lobe > 0) {
        // The runs' own widths widen the lobe.
        const double sigma2 = lobe * lobe + in.angle2 + leaving.angle2;
        const double chord2 = (in.direction - leaving.direction).squaredNorm();
        if (chord2 > 16 * sigma2) continue;
        weight *= std::sqrt(seen.cosine * arriving[p].cosine) * std::exp(-0.5 * chord2 / sigma2) /
                  (2 * kPi * sigma2);
      } else {
        weight *=
            seen.cosine * arriving[p].cosine *
            (brdf == nullptr ? 1 / kPi : brdf->value(cell.normal, in.direction, leaving.direction));
      }
      add(seen_runs_[r].zone, seen.path + arriving[p].path,
          in.variance + leaving.variance + own_variance(in.direction + leaving.direction), weight,
          extra, out);
    }
  }
}

std::vector<SparseLight::Range> CoarseModel::reach() const {
  const Scene& scene = shared_->scene;
  const Sensor& sensor = scene.sensor;
  const auto zones = static_cast<std::size_t>(sensor.zone_count());
  const SparseLight::Range all{0, sensor.bins}, none{sensor.bins, 0};
  std::vector<SparseLight::Range> reached(zones, sensor.crosstalk.empty() ? none : all);
  // Range of the path to the relay patch, times `way`, plus the path from there to a region.
  struct Paths {
    double shortest = std::numeric_limits<double>::infinity(), longest = 0;
  };
  for (int object = 0; object < object_count(scene); ++object) {
    Eigen::AlignedBox3d region;
    for (const Vector3d& corner : search_region_corners(scene, object)) region.extend(corner);
    const auto paths = [&](const PatchArrays& patches, std::size_t set, double way) {
      Paths found;
      const auto [begin, end] = patches.set(set);
      for (std::size_t k = begin; k < end; ++k) {
        const auto i = static_cast<int>(k);
        const Vector3d u = patches.half_u(i), v = patches.half_v(i);
        for (const Vector3d& d : {Vector3d(0 * u), Vector3d(u + v), Vector3d(u - v),
                                  Vector3d(v - u), Vector3d(-u - v)}) {
          const Vector3d from = patches.area_center(i) + d;
          const double leg =
              way * (patches.leg[k] + patches.leg_direction(i).dot(from - patches.center(i)));
          // Paths lead to the region's nearest point and to its farthest corner.
          const Vector3d far = (from - region.center()).cwiseAbs() + 0.5 * region.sizes();
          found.shortest = std::min(found.shortest, leg + region.exteriorDistance(from));
          found.longest = std::max(found.longest, leg + far.norm());
        }
      }
      return found;
    };
    const bool pairs = pairs_[static_cast<std::size_t>(object)];
    for (std::size_t z = 0; z < zones; ++z) {
      const Paths out = paths(seen_, z, pairs ? 1.0 : way_in_);
      const Paths in = pairs ? paths(lit_, confocal_ ? z : 0, 1.0) : out;
      if (out.longest == 0 || in.longest == 0) continue;  // dead zone, or zone without patches
      if (sensor.wrap(static_cast<int>(z)) > 0) {
        reached[z] = all;
        continue;
      }
      const auto bin = [&](double path) {
        return shared_->pulses.reach((sensor.zones[z].time_zero + path / kSpeedOfLight) /
                                     sensor.bin_width);
      };
      const int first = std::max(bin(in.shortest + out.shortest).first, 0);
      const int last = std::min(bin(in.longest + out.longest).second, sensor.bins);
      if (first >= last) continue;
      reached[z] = {std::min(reached[z].begin, first), std::max(reached[z].end, last)};
    }
  }
  for (SparseLight::Range& range : reached) {
    if (range.begin >= range.end) range = {};
  }
  return reached;
}

void CoarseModel::three_bounce(const std::vector<Placement>& placements, double extra_pulse_sigma,
                               SparseLight& out, int only) const {
  const Scene& scene = shared_->scene;
  const Sensor& sensor = scene.sensor;
  const auto zones = static_cast<std::size_t>(sensor.zone_count());
  if (out.cube.rows != sensor.rows || out.cube.columns != sensor.columns ||
      out.cube.bins != sensor.bins) {
    out.cube = HistogramCube(sensor.rows, sensor.columns, sensor.bins);
    out.lit.clear();
  }
  for (std::size_t z = 0; z < out.lit.size(); ++z) {
    double* row = out.cube.zone(static_cast<int>(z));
    std::fill(row + out.lit[z].begin, row + out.lit[z].end, 0.0);
  }
  out.lit.assign(zones, {});

  // The view from the object's middle does not change with yaw. If a grid varies yaw last, one view
  // is enough for all its yaws.
  struct Kept {
    std::uint64_t model = 0;
    Vector3d middle = Vector3d::Zero();
    View view;
  };
  thread_local std::vector<Kept> kept;
  if (kept.size() < placements.size()) kept.resize(placements.size());
  for (std::size_t i = 0; i < placements.size(); ++i) {
    if (only >= 0 && i != static_cast<std::size_t>(only)) continue;
    const HiddenObject& hidden = hidden_object(scene, static_cast<int>(i));
    const Transform T = object_to_world(hidden.shape, hidden.anchor, placements[i]);
    const Vector3d middle = T.translation();
    Kept& mine = kept[i];
    if (mine.model != id_ || mine.middle != middle || placements.size() > 1) {
      mine = {id_, middle, std::move(mine.view)};
      std::vector<OccluderFace> in_the_way = shared_->occluders;
      for (std::size_t j = 0; j < placements.size() && only < 0; ++j) {
        if (j == i) continue;
        MovingBodies bodies;
        bodies.add(hidden_object(scene, static_cast<int>(j)), placements[j]);
        bodies.faces_seen_from(middle, in_the_way);
      }
      see(middle, in_the_way, seen_, seen_runs_, !pairs_[i], mine.view.seen);
      mine.view.lit.clear();
      if (pairs_[i]) see(middle, in_the_way, lit_, lit_runs_, false, mine.view.lit);
    }
    const double extra = extra_pulse_sigma * extra_pulse_sigma;
    for (const SurfaceCell& own : shared_->objects[i].cells) {
      render(placed(own, T, placements[i].size), middle, mine.view, i, extra, out);
    }
  }
  if (!sensor.crosstalk.empty()) {
    mix_zones(sensor, out.cube);
    out.lit.assign(zones, {0, sensor.bins});
  }
}

}  // namespace blindcorner
