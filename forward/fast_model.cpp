// SPDX-License-Identifier: Apache-2.0
/// The fast model: moments of light instead of pairs of paths.
///
/// For a Lambertian object cell q, light arriving at q and light leaving q towards a zone are two
/// independent sums, so their path-length distributions convolve. Each sum is reduced to a few
/// groups of relay patches, each group to weight, mean path and path variance; a pair of groups is
/// then one pulse, blurred by the sum of the variances. What is lost are the groups' third and
/// higher cumulants: with a spread of s = (path std / pulse std)^2 the relative L2 error is about
/// 0.05 s^2, which sets how far regions are divided.
///
/// Pairs of groups with nearly the same path share one pulse: each adds its moments to the two
/// nearest cells of a path axis, in proportion to nearness, so the sum stays continuous in the pose
/// and every moment up to the second is kept.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/forward_model.h"
#include "multiversion.h"
#include "relay_setup.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Gaussian closure: relative L2 error of leaving out a group's higher cumulants, 0.05 s^2 for a
/// path spread of s pulse variances.
constexpr double kClosureError = 0.05;
/// Two Gauss nodes along an edge e at distance r: relative error of weights like cos^4 / r^4 is
/// about 0.01 (e / r)^4.
constexpr double kQuadratureError = 0.01;
/// The centre alone: about 0.35 (e / r)^2.
constexpr double kMidpointError = 0.35;
/// Width of a path cell in pulse standard deviations: pairs in one cell differ by a spread of
/// s = 0.4^2 / 6 = 0.03, whose closure error is below 1e-4. Wider cells leave kinks in the pose.
constexpr double kPathCell = 0.4;
/// Cells before path zero and after the end of the time axis, for pulses that only just reach it.
constexpr int kCellMargin = 16;

/// Structure of arrays, so that the loop over patches vectorises.
struct PatchArrays {
  std::vector<double> x, y, z, ax, ay, az, nx, ny, nz, ux, uy, uz, vx, vy, vz, lx, ly, lz;
  std::vector<double> weight, leg, radiance;
  std::vector<double> spread;   ///< variance of the path over a patch per squared half-edge change
  std::vector<int> group_end;   ///< one past the last patch of each group
  std::vector<int> group_zone;  ///< zone that sees (or lights) the group

  /// Consecutive patches inside a ball, for asking about shadows in bulk.
  struct Block {
    int begin, end;
    Vector3d center;
    double radius;
  };
  std::vector<Block> blocks;

  int size() const { return static_cast<int>(x.size()); }
  void make_blocks();
  void add(const WeightedPatch& p) {
    x.push_back(p.patch.center.x());
    y.push_back(p.patch.center.y());
    z.push_back(p.patch.center.z());
    ax.push_back(p.patch.area_center.x());
    ay.push_back(p.patch.area_center.y());
    az.push_back(p.patch.area_center.z());
    nx.push_back(p.patch.normal.x());
    ny.push_back(p.patch.normal.y());
    nz.push_back(p.patch.normal.z());
    spread.push_back(p.patch.node ? 0.0 : 1.0 / 3);
    ux.push_back(p.patch.half_u.x());
    uy.push_back(p.patch.half_u.y());
    uz.push_back(p.patch.half_u.z());
    vx.push_back(p.patch.half_v.x());
    vy.push_back(p.patch.half_v.y());
    vz.push_back(p.patch.half_v.z());
    lx.push_back(p.leg_direction.x());
    ly.push_back(p.leg_direction.y());
    lz.push_back(p.leg_direction.z());
    weight.push_back(p.weight);
    leg.push_back(p.leg);
    radiance.push_back(p.radiance);
  }
  Vector3d center(int i) const { return at(x, y, z, i); }
  Vector3d area_center(int i) const { return at(ax, ay, az, i); }
  Vector3d normal(int i) const { return at(nx, ny, nz, i); }
  Vector3d half_u(int i) const { return at(ux, uy, uz, i); }
  Vector3d half_v(int i) const { return at(vx, vy, vz, i); }
  Vector3d leg_direction(int i) const { return at(lx, ly, lz, i); }

 private:
  static Vector3d at(const std::vector<double>& a, const std::vector<double>& b,
                     const std::vector<double>& c, int i) {
    const auto k = static_cast<std::size_t>(i);
    return {a[k], b[k], c[k]};
  }
};

void PatchArrays::make_blocks() {
  constexpr int kBlock = 16;
  for (int begin = 0; begin < size(); begin += kBlock) {
    Block block{begin, std::min(begin + kBlock, size()), Vector3d::Zero(), 0.0};
    for (int i = block.begin; i < block.end; ++i) block.center += center(i);
    block.center /= block.end - block.begin;
    for (int i = block.begin; i < block.end; ++i) {
      block.radius = std::max(
          block.radius, (center(i) - block.center).norm() + half_u(i).norm() + half_v(i).norm());
    }
    blocks.push_back(block);
  }
}

/// Appends patches; groups are runs of equal group number, all of one zone.
void append(PatchArrays& arrays, const std::vector<WeightedPatch>& patches, int zone) {
  for (std::size_t i = 0; i < patches.size(); ++i) {
    arrays.add(patches[i]);
    if (i + 1 == patches.size() || patches[i + 1].patch.group != patches[i].patch.group) {
      arrays.group_end.push_back(arrays.size());
      arrays.group_zone.push_back(zone);
    }
  }
}

/// Weighted moments of path length.
struct Moments {
  double weight = 0;
  double path = 0;                       ///< m, mean
  double variance = 0;                   ///< m^2
  Vector3d gradient = Vector3d::Zero();  ///< of the mean path in the object point
};

/// Sums for moments, relative to a base path against cancellation.
struct Sums {
  double weight = 0, first = 0, second = 0;

  void add(double w, double path, double variance) {
    weight += w;
    first += w * path;
    second += w * (path * path + variance);
  }
};

/// Scratch for one evaluation, one per thread.
struct Scratch {
  std::vector<double> weight, path, variance, dx, dy, dz, cosine, rows;
  std::vector<Sums> cells;       ///< [zone][path cell]
  std::vector<Moments> in, out;  ///< [node][group]
  std::vector<Sums> sums;

  void resize(int n) {
    const auto count = static_cast<std::size_t>(n);
    for (auto* v : {&weight, &path, &variance, &dx, &dy, &dz, &cosine}) {
      if (v->size() < count) v->resize(count);
    }
  }
};

/// Point of an object cell.
struct CellNode {
  Vector3d center;
  Vector3d normal;
  double area;
};

constexpr int kNodes = 4;

/// A cell as 2 x 2 Gauss-Legendre nodes, or as its centre with a path variance from its edges.
struct CellNodes {
  std::array<CellNode, kNodes> nodes;
  std::size_t count = kNodes;
  Vector3d half_u = Vector3d::Zero();  ///< zero when the nodes' own spread stands for the cell's
  Vector3d half_v = Vector3d::Zero();

  CellNodes(const SurfaceCell& cell, bool midpoint) {
    if (midpoint) {
      nodes[0] = {cell.center, cell.normal, cell.area};
      count = 1;
      half_u = cell.half_u;
      half_v = cell.half_v;
      return;
    }
    static const double kNode = 1 / std::sqrt(3.0);
    for (std::size_t i = 0; i < kNodes; ++i) {
      nodes[i] = {cell.center + ((i & 1) != 0 ? kNode : -kNode) * cell.half_u +
                      ((i & 2) != 0 ? kNode : -kNode) * cell.half_v,
                  cell.normal, cell.area / kNodes};
    }
  }
  double variance(const Vector3d& gradient) const {
    return (std::pow(gradient.dot(half_u), 2) + std::pow(gradient.dot(half_v), 2)) / 3;
  }
};

/// Exchange between an object point and every patch: weights with both cosines and 1/r^2, paths,
/// path variances over the patch, unit directions from the cell.
BLINDCORNER_MULTIVERSION void exchange(const CellNode& cell, const PatchArrays& a, Scratch& s) {
  const int n = a.size();
  s.resize(n);
  const double qx = cell.center.x(), qy = cell.center.y(), qz = cell.center.z();
  const double mx = cell.normal.x(), my = cell.normal.y(), mz = cell.normal.z();
  const double* __restrict px = a.x.data();
  const double* __restrict py = a.y.data();
  const double* __restrict pz = a.z.data();
  double* __restrict w = s.weight.data();
  double* __restrict l = s.path.data();
  double* __restrict v = s.variance.data();
  double* __restrict ox = s.dx.data();
  double* __restrict oy = s.dy.data();
  double* __restrict oz = s.dz.data();
  double* __restrict oc = s.cosine.data();
  const double *nx = a.nx.data(), *ny = a.ny.data(), *nz = a.nz.data();
  const double *ux = a.ux.data(), *uy = a.uy.data(), *uz = a.uz.data();
  const double *vx = a.vx.data(), *vy = a.vy.data(), *vz = a.vz.data();
  const double *lx = a.lx.data(), *ly = a.ly.data(), *lz = a.lz.data();
  const double *weight = a.weight.data(), *leg = a.leg.data(), *spread = a.spread.data();
  for (int i = 0; i < n; ++i) {
    const double x = px[i] - qx, y = py[i] - qy, z = pz[i] - qz;
    const double r2 = x * x + y * y + z * z;
    const double r = std::sqrt(r2);
    const double inverse = 1 / r;
    const double dx = x * inverse, dy = y * inverse, dz = z * inverse;
    const double cell_cosine = dx * mx + dy * my + dz * mz;
    const double relay_cosine = -(dx * nx[i] + dy * ny[i] + dz * nz[i]);
    const double product = std::max(cell_cosine, 0.0) * std::max(relay_cosine, 0.0);
    const double gx = dx + lx[i], gy = dy + ly[i], gz = dz + lz[i];
    const double gu = gx * ux[i] + gy * uy[i] + gz * uz[i];
    const double gv = gx * vx[i] + gy * vy[i] + gz * vz[i];
    w[i] = weight[i] * product / r2;
    l[i] = leg[i] + r;
    v[i] = spread[i] * (gu * gu + gv * gv);
    ox[i] = dx;
    oy[i] = dy;
    oz[i] = dz;
    oc[i] = cell_cosine;
  }
}

class FastModel final : public ForwardModel {
 public:
  FastModel(const Scene& scene, const SensorPlacement& placement, const FastModelOptions& options);

  using ForwardModel::three_bounce;
  void three_bounce(const PoseVector& pose, HistogramCube& out) const override;
  const HistogramCube& direct_return() const override { return direct_; }
  const TransportPlan& plan() const override { return plan_; }

 private:
  using Shadows = std::vector<ShadowView>;  // one per node; empty without occluders

  void sample_relay(double spread, double aspect, double tolerance);
  void sample_object(double spread, double aspect, double tolerance);
  /// Whether any seen patch may lie on the cell's front side.
  bool faces_relay(const SurfaceCell& cell) const {
    return std::any_of(seen_.blocks.begin(), seen_.blocks.end(), [&](const auto& block) {
      return cell.normal.dot(block.center - cell.center) > -block.radius;
    });
  }
  void lambertian(const CellNodes& cell, const Shadows& shadows, Scratch& s) const;
  void retro_single(const CellNodes& cell, const Shadows& shadows, Scratch& s) const;
  void retro_pairs(const CellNodes& cell, const Shadows& shadows, Scratch& s) const;
  void light_between(const CellNode& node, const PatchArrays& arrays, const ShadowView* shadows,
                     Scratch& s) const;
  void shade(const CellNode& node, const PatchArrays& arrays, const ShadowView& shadows, int patch,
             Scratch& s) const;
  void group_moments(const PatchArrays& arrays, const Scratch& s, Moments* groups) const;
  void add_pulse(Scratch& s, int zone, const Sums& sums) const;
  void flush(Scratch& s) const;
  void add_pulse(Scratch& s, int zone, double weight, double path, double variance) const;

  Scene scene_;
  RelaySetup setup_;
  TransportPlan plan_;
  bool confocal_;
  double pulse_sigma_;     ///< m of path, pulse, bin and extra blur together
  double extra_variance_;  ///< s^2
  double object_edge_ = 1.0;
  bool object_midpoint_ = false;  ///< cells are so small that their centres will do
  PulseTable pulses_;
  HistogramCube direct_;
  PatchArrays lit_;   ///< of the flash field, or of all zones one after the other (confocal)
  PatchArrays seen_;  ///< of all zones, one after the other
  int axis_bins_;
  double bins_per_metre_;
  double cells_per_metre_;
  int path_cells_;
};

FastModel::FastModel(const Scene& scene, const SensorPlacement& placement,
                     const FastModelOptions& options)
    : scene_(scene),
      setup_(scene_, placement),
      plan_(make_plan(scene_, setup_.relay_points(), setup_.lit_extent())),
      confocal_(scene.sensor.illumination == Illumination::confocal),
      pulse_sigma_(kSpeedOfLight * std::hypot(scene.sensor.response.core_sigma(),
                                              scene.sensor.bin_width / std::sqrt(12.0),
                                              options.extra_pulse_sigma)),
      extra_variance_(options.extra_pulse_sigma * options.extra_pulse_sigma),
      pulses_(scene.sensor.response, scene.sensor.bin_width,
              extra_variance_ + 4 * std::pow(pulse_sigma_ / kSpeedOfLight, 2), 1e-4),
      axis_bins_(unwrapped_bins(scene.sensor)),
      bins_per_metre_(1 / (kSpeedOfLight * scene.sensor.bin_width)),
      cells_per_metre_(1 / (kPathCell * pulse_sigma_)),
      path_cells_(static_cast<int>(axis_bins_ / bins_per_metre_ * cells_per_metre_) +
                  2 * kCellMargin) {
  if (scene_.linear.direct == LinearMode::fixed && scene_.linear.fixed_direct == 0) {
    direct_ = HistogramCube(scene_.sensor.rows, scene_.sensor.columns, scene_.sensor.bins);
  } else {
    const PulseTable tails(scene.sensor.response, scene.sensor.bin_width,
                           std::pow(scene.sensor.response.core_sigma(), 2), 1e-7);
    direct_ = setup_.direct_return(tails, 10, true);
  }
  // The largest path spread that one Gaussian may stand for, and the largest cell against its
  // distance, both from the tolerance.
  // Six axes share each limit: two each of what is lit, what is seen and the object.
  constexpr double kAxes = 6;
  const double spread =
      pulse_sigma_ * std::pow(options.tolerance / kClosureError, 0.25) / std::sqrt(kAxes);
  const double aspect = std::pow(options.tolerance / kQuadratureError / kAxes, 0.25);
  sample_relay(spread, aspect, options.tolerance);
  sample_object(spread, aspect, options.tolerance);
}

/// How bright parts of the relay are, judged over the probed placements: dim parts may be sampled
/// more coarsely, and what adds up to next to nothing is left out.
class Brightness {
 public:
  Brightness(std::vector<Vector3d> objects, bool twice)
      : objects_(std::move(objects)), twice_(twice) {}

  /// Light exchanged per solid angle of the patch, up to a constant.
  double density(const RelayPatch& patch) const {
    double sum = 0;
    for (const Vector3d& q : objects_) {
      const Vector3d way = q - patch.center;
      sum += std::max(way.dot(patch.normal), 0.0) / std::pow(way.norm(), 3);
    }
    return patch.albedo * sum / (twice_ ? patch.distance * patch.distance : 1.0);
  }

  void learn(const RelayPatch& patch) {
    cells_.push_back({density(patch), density(patch) * patch.solid_angle});
  }
  void finish() {
    std::sort(cells_.begin(), cells_.end());
    double sum = 0;
    for (auto& [density, light] : cells_) light = sum += light;
    for (auto& [density, light] : cells_) light /= std::max(sum, 1e-300);
  }
  /// Share of all light that comes from parts no brighter than this.
  double share_below(double density) const {
    const auto it = std::upper_bound(cells_.begin(), cells_.end(), std::pair(density, 2.0));
    return it == cells_.begin() ? 0.0 : std::prev(it)->second;
  }

 private:
  std::vector<Vector3d> objects_;
  bool twice_;
  std::vector<std::pair<double, double>> cells_;  // density, cumulative share
};

/// Divides what is lit and seen until cells meet both limits in the root mean square over the
/// probed placements: a bound for the typical pose, not for the one that touches the relay. Parts
/// below which a share C of the light comes may be (0.5 / C)^0.15 coarser: their closure error
/// grows with the fourth power, and the sum of share times error stays within a factor of two.
void FastModel::sample_relay(double spread, double aspect, double tolerance) {
  std::vector<Vector3d> objects;
  for (const Placement& p : probe_placements(scene_)) {
    objects.push_back(object_to_world(scene_.hidden.shape, scene_.hidden.anchor, p).translation());
  }
  const Vector3d origin = setup_.origin();
  const bool single = plan_.kernel == Kernel::retro_single;
  RelaySampling sampling;
  const double midpoint = std::sqrt(tolerance / kMidpointError);
  sampling.gauss = [&](const RelayPatch& patch) {
    const double edge = 2 * std::max(patch.half_u.norm(), patch.half_v.norm());
    return std::any_of(objects.begin(), objects.end(), [&](const Vector3d& q) {
      return edge > midpoint * (patch.center - q).norm();
    });
  };
  const auto splitter = [&](const Brightness& brightness) {
    return [&](const RelayPatch& patch) {
      const double below = std::max(brightness.share_below(brightness.density(patch)), 1e-6);
      const double relaxed = std::max(1.0, std::pow(0.5 / below, 0.15));
      double path_u = 0, path_v = 0, angle_u = 0, angle_v = 0;
      for (const Vector3d& q : objects) {
        const Vector3d way = patch.center - q;
        const Vector3d g =
            (single ? 2 : 1) * (way.normalized() + (patch.center - origin).normalized());
        path_u += std::pow(g.dot(patch.half_u), 2) / 3;
        path_v += std::pow(g.dot(patch.half_v), 2) / 3;
        angle_u += 4 * patch.half_u.squaredNorm() / way.squaredNorm();
        angle_v += 4 * patch.half_v.squaredNorm() / way.squaredNorm();
      }
      const auto count = static_cast<double>(objects.size());
      const double u =
          std::max(std::sqrt(path_u / count) / spread, std::sqrt(angle_u / count) / aspect);
      const double v =
          std::max(std::sqrt(path_v / count) / spread, std::sqrt(angle_v / count) / aspect);
      if (std::max(u, v) <= relaxed) return 0;
      return u >= v ? 1 : 2;
    };
  };
  // Dim parts that together hold less than this share are left out.
  const double negligible = 0.03 * tolerance;
  const auto prune = [&](std::vector<WeightedPatch> patches, const Brightness& brightness) {
    std::erase_if(patches, [&](const WeightedPatch& p) {
      return brightness.share_below(brightness.density(p.patch)) < negligible;
    });
    return patches;
  };
  RelaySampling coarse;
  coarse.divisions = 5;
  coarse.edge_depth = 2;
  const int zones = scene_.sensor.zone_count();
  const auto dead = [&](int z) { return scene_.sensor.zones[static_cast<std::size_t>(z)].dead; };

  Brightness seen(objects, single);
  for (int z = 0; z < zones; ++z) {
    if (dead(z)) continue;
    for (const WeightedPatch& p : setup_.seen(z, coarse)) seen.learn(p.patch);
  }
  seen.finish();
  sampling.split = splitter(seen);
  for (int z = 0; z < zones; ++z) {
    if (dead(z)) continue;
    append(seen_, prune(setup_.seen(z, sampling), seen), z);
    if (confocal_ && !single) append(lit_, setup_.lit_by_zone(z, sampling), z);
  }
  if (!confocal_ && !single) {
    Brightness lit(objects, false);
    coarse.divisions = 12;
    for (const WeightedPatch& p : setup_.lit(coarse)) lit.learn(p.patch);
    lit.finish();
    sampling.split = splitter(lit);
    append(lit_, prune(setup_.lit(sampling), lit), -1);
  }
  lit_.make_blocks();
  seen_.make_blocks();
}

/// Divides the object until its cells meet both limits, cells weighted with the light that they
/// would exchange.
void FastModel::sample_object(double spread, double aspect, double tolerance) {
  const double extent = 2 * bounding_radius(scene_.hidden.shape, Anchor::center);
  const int stride = std::max(1, seen_.size() / 64);
  for (object_edge_ = extent; object_edge_ > extent / 64; object_edge_ /= 1.25) {
    double weight = 0;
    double path = 0;
    double angle = 0;
    for (const Placement& p : probe_placements(scene_)) {
      const Transform T = object_to_world(scene_.hidden.shape, scene_.hidden.anchor, p);
      for (const SurfaceCell& cell : divide(scene_.hidden.shape, T, p.size, object_edge_, 1)) {
        for (int i = 0; i < seen_.size(); i += stride) {
          const Vector3d way = seen_.center(i) - cell.center;
          const double r = way.norm();
          const double cosine = way.dot(cell.normal) / r;
          if (cosine <= 0) continue;
          const double w = cosine * cosine * cell.area / std::pow(r, 4);
          const double u = 2 * way.dot(cell.half_u) / r;
          const double v = 2 * way.dot(cell.half_v) / r;
          weight += w;
          path += w * std::max(u * u, v * v) / 3;
          angle += w * 4 * std::max(cell.half_u.squaredNorm(), cell.half_v.squaredNorm()) / (r * r);
        }
      }
    }
    if (weight <= 0) continue;
    object_midpoint_ = std::sqrt(angle / weight) <= std::sqrt(tolerance / kMidpointError);
    if (std::sqrt(path / weight) <= spread && std::sqrt(angle / weight) <= aspect) break;
  }
}

/// Weights, paths and directions between a node and all patches, shadows included.
void FastModel::light_between(const CellNode& node, const PatchArrays& arrays,
                              const ShadowView* shadows, Scratch& s) const {
  exchange(node, arrays, s);
  if (shadows == nullptr) return;
  for (const PatchArrays::Block& block : arrays.blocks) {
    const ShadowView::Sight sight = shadows->sight(block.center, block.radius);
    if (sight == ShadowView::Sight::clear) continue;
    if (sight == ShadowView::Sight::hidden) {
      std::fill(s.weight.begin() + block.begin, s.weight.begin() + block.end, 0.0);
      continue;
    }
    for (int i = block.begin; i < block.end; ++i) shade(node, arrays, *shadows, i, s);
  }
}

/// Takes the shadowed part of one patch away.
void FastModel::shade(const CellNode& node, const PatchArrays& arrays, const ShadowView& shadows,
                      int patch, Scratch& s) const {
  const auto k = static_cast<std::size_t>(patch);
  if (s.weight[k] <= 0) return;
  const VisiblePart part =
      shadows.see(arrays.area_center(patch), arrays.half_u(patch), arrays.half_v(patch));
  if (part.fraction >= 1) return;
  if (part.fraction <= 0) {
    s.weight[k] = 0;
    return;
  }
  // The visible part's own centre.
  const Vector3d way = arrays.center(patch) + part.shift - node.center;
  const double r = way.norm();
  const Vector3d direction = way / r;
  const double cell_cosine = std::max(direction.dot(node.normal), 0.0);
  const double relay_cosine = std::max(-direction.dot(arrays.normal(patch)), 0.0);
  s.weight[k] = part.fraction * arrays.weight[k] * cell_cosine * relay_cosine / (r * r);
  s.path[k] = arrays.leg[k] + arrays.leg_direction(patch).dot(part.shift) + r;
  s.variance[k] *= part.fraction * part.fraction;
  s.dx[k] = direction.x();
  s.dy[k] = direction.y();
  s.dz[k] = direction.z();
  s.cosine[k] = cell_cosine;
}

void FastModel::group_moments(const PatchArrays& arrays, const Scratch& s, Moments* groups) const {
  std::size_t begin = 0;
  for (std::size_t g = 0; g < arrays.group_end.size(); ++g) {
    const auto end = static_cast<std::size_t>(arrays.group_end[g]);
    const double base = s.path[begin];
    Sums sums;
    double gx = 0, gy = 0, gz = 0;
    for (std::size_t i = begin; i < end; ++i) {
      sums.add(s.weight[i], s.path[i] - base, s.variance[i]);
      gx -= s.weight[i] * s.dx[i];
      gy -= s.weight[i] * s.dy[i];
      gz -= s.weight[i] * s.dz[i];
    }
    begin = end;
    groups[g] = {};
    if (sums.weight <= 0) continue;
    const double mean = sums.first / sums.weight;
    groups[g] = {sums.weight, base + mean, std::max(sums.second / sums.weight - mean * mean, 0.0),
                 Vector3d(gx, gy, gz) / sums.weight};
  }
}

void FastModel::add_pulse(Scratch& s, int zone, double weight, double path, double variance) const {
  const double position = path * cells_per_metre_ + kCellMargin;
  if (!(position >= 0 && position < path_cells_ - 1)) return;
  const auto cell = static_cast<std::size_t>(position);
  const double share = position - static_cast<double>(cell);
  Sums* cells = s.cells.data() + static_cast<std::ptrdiff_t>(zone) * path_cells_ + cell;
  // Relative to the cell's own path, against cancellation.
  const double offset = share / cells_per_metre_;
  cells[0].add(weight * (1 - share), offset, variance);
  cells[1].add(weight * share, offset - 1 / cells_per_metre_, variance);
}

/// One pulse for each path cell that holds light.
void FastModel::flush(Scratch& s) const {
  for (int z = 0; z < scene_.sensor.zone_count(); ++z) {
    const double start =
        scene_.sensor.zones[static_cast<std::size_t>(z)].time_zero / scene_.sensor.bin_width;
    const Sums* cells = s.cells.data() + static_cast<std::ptrdiff_t>(z) * path_cells_;
    double* row = s.rows.data() + static_cast<std::ptrdiff_t>(z) * axis_bins_;
    for (int c = 0; c < path_cells_; ++c) {
      if (cells[c].weight <= 0) continue;
      const double mean = cells[c].first / cells[c].weight;
      const double variance = std::max(cells[c].second / cells[c].weight - mean * mean, 0.0);
      const double path = (c - kCellMargin) / cells_per_metre_ + mean;
      pulses_.add(row, axis_bins_, start + path * bins_per_metre_,
                  variance / (kSpeedOfLight * kSpeedOfLight) + extra_variance_, cells[c].weight);
    }
  }
}

void FastModel::add_pulse(Scratch& s, int zone, const Sums& sums) const {
  if (sums.weight <= 0) return;
  const double mean = sums.first / sums.weight;
  add_pulse(s, zone, sums.weight, mean, std::max(sums.second / sums.weight - mean * mean, 0.0));
}

/// Light arriving and light leaving, moments per node and group, one pulse per pair of groups with
/// the nodes of the cell taken together.
void FastModel::lambertian(const CellNodes& cell, const Shadows& shadows, Scratch& s) const {
  const std::size_t in_groups = lit_.group_end.size();
  const std::size_t out_groups = seen_.group_end.size();
  s.in.resize(cell.count * in_groups);
  s.out.resize(cell.count * out_groups);
  for (std::size_t n = 0; n < cell.count; ++n) {
    const ShadowView* view = shadows.empty() ? nullptr : &shadows[n];
    light_between(cell.nodes[n], lit_, view, s);
    group_moments(lit_, s, s.in.data() + n * in_groups);
    light_between(cell.nodes[n], seen_, view, s);
    group_moments(seen_, s, s.out.data() + n * out_groups);
  }
  const double scattered = scene_.hidden.albedo / kPi;
  for (std::size_t o = 0; o < out_groups; ++o) {
    for (std::size_t i = 0; i < in_groups; ++i) {
      if (confocal_ && lit_.group_zone[i] != seen_.group_zone[o]) continue;
      Sums sums;
      double base = 0;
      for (std::size_t n = 0; n < cell.count; ++n) {
        const Moments& in = s.in[n * in_groups + i];
        const Moments& out = s.out[n * out_groups + o];
        const double weight = scattered * cell.nodes[n].area * in.weight * out.weight;
        if (weight <= 0) continue;
        if (sums.weight == 0) base = in.path + out.path;
        sums.add(weight, in.path + out.path - base,
                 in.variance + out.variance + cell.variance(in.gradient + out.gradient));
      }
      if (sums.weight <= 0) continue;
      const double mean = sums.first / sums.weight;
      add_pulse(s, seen_.group_zone[o], sums.weight, base + mean,
                std::max(sums.second / sums.weight - mean * mean, 0.0));
    }
  }
}

/// The lobe is small against the lit spot: light comes back from where it fell. Integrating the
/// lobe over p leaves the radiance at r, and the fall-off is 1/r^2.
void FastModel::retro_single(const CellNodes& cell, const Shadows& shadows, Scratch& s) const {
  const double sigma = std::get<RetroreflectiveMaterial>(scene_.hidden.material).lobe_sigma;
  // Both outer legs are the patch's own; counted from the relay they cancel.
  const double way_in = scene_.sensor.path_origin == PathOrigin::sensor ? 1 : 0;
  const PatchArrays& a = seen_;
  s.sums.assign(a.group_end.size(), {});
  for (std::size_t n = 0; n < cell.count; ++n) {
    light_between(cell.nodes[n], a, shadows.empty() ? nullptr : &shadows[n], s);
    int begin = 0;
    for (std::size_t g = 0; g < a.group_end.size(); ++g) {
      for (int i = begin; i < a.group_end[g]; ++i) {
        const auto k = static_cast<std::size_t>(i);
        const double w = s.weight[k] * a.radiance[k] * scene_.hidden.albedo * cell.nodes[n].area;
        if (w <= 0) continue;
        const Vector3d d(s.dx[k], s.dy[k], s.dz[k]);
        const double r = s.path[k] - a.leg[k];
        // Lobe: p scatters about r by sigma r, stretched along the tilt by 1/cos.
        const Vector3d normal = a.normal(i);
        const double cosine = std::max(-d.dot(normal), 0.05);
        const Vector3d change = way_in * a.leg_direction(i) + d;
        const Vector3d tangential = change - change.dot(normal) * normal;
        const Vector3d tilt = d - d.dot(normal) * normal;
        const double tilt_norm = tilt.norm();
        const double along = tilt_norm > 1e-9 ? tangential.dot(tilt) / tilt_norm : 0.0;
        const double across2 = std::max(tangential.squaredNorm() - along * along, 0.0);
        const double lobe = sigma * sigma * r * r * (along * along / (cosine * cosine) + across2);
        s.sums[g].add(w, way_in * 2 * a.leg[k] + 2 * r,
                      4 * s.variance[k] + lobe + 4 * cell.variance(d));
      }
      begin = a.group_end[g];
    }
  }
  for (std::size_t g = 0; g < a.group_end.size(); ++g) add_pulse(s, a.group_zone[g], s.sums[g]);
}

/// Wide lobes: every pair of a lit and a seen patch, weighted with the lobe averaged over both
/// patches (a Gaussian whose covariance is the lobe's plus the patches' own angular extents).
void FastModel::retro_pairs(const CellNodes& cell, const Shadows& shadows, Scratch& s) const {
  const double sigma2 =
      std::pow(std::get<RetroreflectiveMaterial>(scene_.hidden.material).lobe_sigma, 2);
  struct End {
    double weight, path, variance, cosine;
    Vector3d direction, u, v;  // unit; angular half extents
    std::size_t group;
  };
  const auto ends = [&](const CellNode& node, const PatchArrays& a, const ShadowView* view) {
    light_between(node, a, view, s);
    std::vector<End> list;
    std::size_t group = 0;
    for (int i = 0; i < a.size(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      while (i >= a.group_end[group]) ++group;
      if (s.weight[k] <= 0) continue;
      const Vector3d d(s.dx[k], s.dy[k], s.dz[k]);
      const double r = (a.center(i) - node.center).norm();
      const Vector3d u = a.half_u(i) / r;
      const Vector3d v = a.half_v(i) / r;
      list.push_back({s.weight[k] / s.cosine[k], s.path[k], s.variance[k], s.cosine[k], d,
                      u - u.dot(d) * d, v - v.dot(d) * d, group});
    }
    return list;
  };
  const std::size_t in_groups = lit_.group_end.size();
  s.sums.assign(in_groups * seen_.group_end.size(), {});
  for (std::size_t n = 0; n < cell.count; ++n) {
    const ShadowView* view = shadows.empty() ? nullptr : &shadows[n];
    const std::vector<End> in = ends(cell.nodes[n], lit_, view);
    for (const End& r : ends(cell.nodes[n], seen_, view)) {
      const Vector3d e1 = r.direction.unitOrthogonal();
      const Vector3d e2 = r.direction.cross(e1);
      // Angular covariance (11, 22, 12) of a patch seen from the node.
      const auto extent = [&](const End& end) -> Vector3d {
        const double u1 = end.u.dot(e1), u2 = end.u.dot(e2);
        const double v1 = end.v.dot(e1), v2 = end.v.dot(e2);
        return Vector3d(u1 * u1 + v1 * v1, u2 * u2 + v2 * v2, u1 * u2 + v1 * v2) / 3;
      };
      const Vector3d own = extent(r);
      for (const End& p : in) {
        if (confocal_ && lit_.group_zone[p.group] != seen_.group_zone[r.group]) continue;
        const Vector3d other = extent(p);
        const double c11 = sigma2 + own.x() + other.x();
        const double c22 = sigma2 + own.y() + other.y();
        const double c12 = own.z() + other.z();
        const double det = c11 * c22 - c12 * c12;
        const Vector3d delta = p.direction - r.direction;
        const double a = delta.dot(e1), b = delta.dot(e2);
        const double exponent = (c22 * a * a - 2 * c12 * a * b + c11 * b * b) / det;
        if (exponent > 30) continue;
        const double lobe = std::exp(-0.5 * exponent) / (2 * kPi * std::sqrt(det));
        s.sums[r.group * in_groups + p.group].add(
            scene_.hidden.albedo * cell.nodes[n].area * r.weight * p.weight * lobe *
                std::sqrt(r.cosine * p.cosine),
            r.path + p.path, r.variance + p.variance + cell.variance(r.direction + p.direction));
      }
    }
  }
  for (std::size_t g = 0; g < s.sums.size(); ++g) {
    add_pulse(s, seen_.group_zone[g / in_groups], s.sums[g]);
  }
}

void FastModel::three_bounce(const PoseVector& pose, HistogramCube& out) const {
  const Sensor& sensor = scene_.sensor;
  if (out.rows != sensor.rows || out.columns != sensor.columns || out.bins != sensor.bins) {
    out = HistogramCube(sensor.rows, sensor.columns, sensor.bins);
  } else {
    std::fill(out.values.begin(), out.values.end(), 0.0);
  }
  thread_local Scratch scratch;
  const int zones = sensor.zone_count();
  scratch.rows.assign(static_cast<std::size_t>(zones) * static_cast<std::size_t>(axis_bins_), 0.0);
  scratch.cells.assign(static_cast<std::size_t>(zones) * static_cast<std::size_t>(path_cells_), {});

  const HiddenObject& hidden = scene_.hidden;
  const Placement placement = place(hidden.placement, scene_.unknowns, pose);
  const Transform T = object_to_world(hidden.shape, hidden.anchor, placement);
  Shadows shadows;
  for (const SurfaceCell& cell : divide(hidden.shape, T, placement.size, object_edge_, 1)) {
    if (!faces_relay(cell)) continue;
    const CellNodes nodes(cell, object_midpoint_);
    if (!plan_.occluders.empty()) {
      shadows.clear();
      for (std::size_t n = 0; n < nodes.count; ++n) {
        shadows.emplace_back(plan_.occluders, nodes.nodes[n].center);
      }
    }
    switch (plan_.kernel) {
      case Kernel::lambertian:
        lambertian(nodes, shadows, scratch);
        break;
      case Kernel::retro_single:
        retro_single(nodes, shadows, scratch);
        break;
      case Kernel::retro_pairs:
        retro_pairs(nodes, shadows, scratch);
        break;
    }
  }
  flush(scratch);
  for (int z = 0; z < zones; ++z) {
    fold(sensor, scratch.rows.data() + static_cast<std::ptrdiff_t>(z) * axis_bins_, axis_bins_,
         out.zone(z));
  }
}

}  // namespace

void FastModelOptions::validate() const {
  if (!(tolerance > 0 && tolerance < 1)) {
    throw Error("FastModelOptions.tolerance", "accepted: between 0 and 1");
  }
  if (!(extra_pulse_sigma >= 0)) {
    throw Error("FastModelOptions.extra_pulse_sigma", "accepted: at least 0 s");
  }
}

std::unique_ptr<ForwardModel> make_fast_model(const Scene& scene, const SensorPlacement& placement,
                                              const FastModelOptions& options) {
  options.validate();
  return std::make_unique<FastModel>(scene, placement, options);
}

}  // namespace blindcorner
