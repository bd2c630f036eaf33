// SPDX-License-Identifier: Apache-2.0
/// The fast model: sums over light arriving and light leaving instead of pairs of paths.
///
/// For a point q of a Lambertian object, light arriving at q and light leaving q towards a zone are
/// two independent sums, so their path-length distributions convolve. Each is laid on a grid of
/// paths (path_grid.h); the pairs of all object points of a zone are summed there and become bins
/// once. Relay and object are sampled by Gauss-Legendre rules: what they integrate is smooth but
/// for shadows' edges, so that few points do. A rule of n points over a stretch whose path changes
/// by 2a errs like exp(-2 (n s / a)^2), s the pulse's width, as long as it resolves the inverse
/// squares too.
///
/// A retroreflector sends light back to where it came from: groups of relay patches, or pairs of
/// them, are one pulse each, of their weight, mean path and path variance. Pulses with nearly the
/// same path share one: each adds its moments to the two nearest cells of a path axis, in
/// proportion to nearness, so the sum stays continuous in the pose and every moment up to the
/// second is kept.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <limits>
#include <mutex>
#include <numbers>
#include <span>
#include <string>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/forward_model.h"
#include "blindcorner/forward/multiversion.h"
#include "lobe_field.h"
#include "lobe_pairs.h"
#include "measured_law_model.h"
#include "path_grid.h"
#include "relay_setup.h"
#include "static_bounces.h"

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
/// Gauss-Legendre points a distance d apart in path (standard deviation of even light between
/// them) for which the error exp(-2 (n s / a)^2) is e: d = kRuleSpread s / sqrt(ln(1 / e)).
constexpr double kRuleSpread = 0.75;
/// The same for points seen an angle apart, against inverse squares: an angle over ln(1 / e). The
/// relay's error is as large for the directions along which no path changes, and there a point more
/// costs little; the object is small.
constexpr double kRelayRuleAngle = 0.5;
constexpr double kObjectRuleAngle = 1.8;
/// Most points along an edge of a relay cell; larger cells are halved, so that dim ones can do with
/// fewer points.
constexpr double kMostRulePoints = 8;
/// Quarterings of a cell that straddles a border; what is left of it is shared between the
/// surfaces, and deeper ones change no shipped scene's error by 1e-4 of the light.
constexpr int kEdgeDepth = 2;
/// Width of a relay patch in standard deviations of the lobe, as seen from the object.
constexpr double kLobePatch = 1.5;
/// Coarseness of sampling that is looked at, and the ratio from one to the next.
constexpr double kCoarsest = 5.657;
constexpr double kFinest = 0.45;
constexpr double kCoarsenessStep = 1.41421356;
/// The same for rules of points, whose error falls so fast that smaller steps pay.
constexpr double kRuleStep = 1.18920712;
constexpr double kRuleFinest = 0.3;
/// Most pairs of lit and seen patches that a lobe's model takes for an evaluation (about 0.2 s):
/// the search for a sampling ends there, whatever the tolerance.
constexpr double kMostPairs = 4e7;
/// Width of a path cell in pulse standard deviations: pairs in one cell differ by a spread of
/// s = 0.4^2 / 6 = 0.03, whose closure error is below 1e-4. Wider cells leave kinks in the pose.
constexpr double kPathCell = 0.4;
/// Cells before path zero and after the end of the time axis, for pulses that only just reach it:
/// four standard deviations of the widest.
constexpr int kCellMargin = 64;
/// Share of the light, in units of the tolerance, below which dim patches are left out together.
constexpr double kNegligible = 0.03;
/// What that may change a bin by, in the same unit: the shares are means over the probed
/// placements, and a pose near the dim patches sees more of them.
constexpr double kDimBound = 0.3;
/// Less than this of a lobe's light is none.
constexpr double kNoShare = 1e-7;

std::string text_of(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2g", value);
  return text;
}

/// Sampling of the known scene's own later bounces, which a fit needs once per sensor placement,
/// and of the estimate that decides whether it needs them.
constexpr StaticSampling kBounces{1, 5, 1.5, 24};
constexpr StaticSampling kBouncesEstimate{1, 3, 4.0, 8};
/// Later bounces below this share of the tolerance are left out: the estimate's own uncertainty.
constexpr double kBouncesMatter = 0.5;

/// Structure of arrays, so that the loop over patches vectorises.
struct PatchArrays {
  std::vector<double> x, y, z, ax, ay, az, nx, ny, nz, ux, uy, uz, vx, vy, vz, lx, ly, lz;
  std::vector<double> weight, leg, radiance;
  std::vector<double> spread;   ///< variance of the path over a patch per squared half-edge change
  std::vector<int> group_end;   ///< one past the last patch of each group
  std::vector<int> group_zone;  ///< zone that sees (or lights) the group
  std::vector<int> set_end;     ///< one past the last patch of each set appended

  /// Consecutive patches whose areas lie inside a ball, for asking about shadows in bulk.
  struct Block {
    int begin, end;
    Vector3d center;
    double radius;
  };
  std::vector<Block> blocks;
  Vector3d center_of_all = Vector3d::Zero();  ///< of a ball around all patches
  double radius_of_all = 0;

  static constexpr int kBlock = ShadowView::kChunk;

  int size() const { return static_cast<int>(x.size()); }
  /// Of the areas that the patches stand for.
  PatchCoordinates coordinates() const {
    return {{ax.data(), ay.data(), az.data()},
            {ux.data(), uy.data(), uz.data()},
            {vx.data(), vy.data(), vz.data()}};
  }
  /// Appends the patches of a zone, or of none (-1), as a set; groups are runs of equal number.
  void append(const std::vector<WeightedPatch>& patches, int zone);
  /// After the last patch: blocks, and room to look at whole blocks.
  void finish();
  std::pair<std::size_t, std::size_t> set(std::size_t i) const {
    return {i == 0 ? 0 : static_cast<std::size_t>(set_end[i - 1]),
            static_cast<std::size_t>(set_end[i])};
  }
  Vector3d center(int i) const { return at(x, y, z, i); }
  Vector3d area_center(int i) const { return at(ax, ay, az, i); }
  Vector3d normal(int i) const { return at(nx, ny, nz, i); }
  Vector3d half_u(int i) const { return at(ux, uy, uz, i); }
  Vector3d half_v(int i) const { return at(vx, vy, vz, i); }
  Vector3d leg_direction(int i) const { return at(lx, ly, lz, i); }

 private:
  void add(const WeightedPatch& p) {
    const RelayPatch& patch = p.patch;
    const auto put = [](const Vector3d& v, std::vector<double>& a, std::vector<double>& b,
                        std::vector<double>& c) {
      a.push_back(v.x());
      b.push_back(v.y());
      c.push_back(v.z());
    };
    put(patch.center, x, y, z);
    put(patch.area_center, ax, ay, az);
    put(patch.normal, nx, ny, nz);
    put(patch.half_u, ux, uy, uz);
    put(patch.half_v, vx, vy, vz);
    put(p.leg_direction, lx, ly, lz);
    spread.push_back(patch.node ? 0.0 : 1.0 / 3);
    weight.push_back(p.weight);
    leg.push_back(p.leg);
    radiance.push_back(p.radiance);
  }
  static Vector3d at(const std::vector<double>& a, const std::vector<double>& b,
                     const std::vector<double>& c, int i) {
    const auto k = static_cast<std::size_t>(i);
    return {a[k], b[k], c[k]};
  }
};

void PatchArrays::finish() {
  const auto whole = static_cast<std::size_t>((size() + kBlock - 1) / kBlock * kBlock);
  for (auto* v : {&ax, &ay, &az, &ux, &uy, &uz, &vx, &vy, &vz}) v->resize(whole, 0.0);
  for (int begin = 0; begin < size(); begin += kBlock) {
    Block block{begin, std::min(begin + kBlock, size()), Vector3d::Zero(), 0.0};
    for (int i = block.begin; i < block.end; ++i) block.center += area_center(i);
    block.center /= block.end - block.begin;
    for (int i = block.begin; i < block.end; ++i) {
      block.radius = std::max(block.radius, (area_center(i) - block.center).norm() +
                                                half_u(i).norm() + half_v(i).norm());
    }
    blocks.push_back(block);
    center_of_all += block.center;
  }
  if (!blocks.empty()) center_of_all /= static_cast<double>(blocks.size());
  for (const Block& b : blocks) {
    radius_of_all = std::max(radius_of_all, (b.center - center_of_all).norm() + b.radius);
  }
}

void PatchArrays::append(const std::vector<WeightedPatch>& patches, int zone) {
  for (std::size_t i = 0; i < patches.size(); ++i) {
    add(patches[i]);
    if (i + 1 == patches.size() || patches[i + 1].patch.group != patches[i].patch.group) {
      group_end.push_back(size());
      group_zone.push_back(zone);
    }
  }
  set_end.push_back(size());
}

/// Light of patches by themselves, as sums.
struct LightSums {
  std::vector<double> weight;  ///< sum w
  std::vector<double> first;   ///< sum w p, p the path
  std::vector<double> second;  ///< sum w (p^2 + variance of p over patch and cell)

  void resize(std::size_t count) {
    for (auto* v : {&weight, &first, &second}) {
      if (v->size() < count) v->resize(count);
    }
  }
};

/// Weight, first and second moment of path about some base; padded to one vector.
struct alignas(32) Sums {
  double weight = 0, first = 0, second = 0, unused = 0;
};

/// Path cells [begin, end) in use.
struct Range {
  int begin = std::numeric_limits<int>::max(), end = 0;
};

/// What lobes about every seen patch gather, as seen from one place on the object.
struct LobeLight {
  std::vector<double> radiance;  ///< mean over the lobe, W/m^2/sr
  std::vector<double> shift;     ///< m, mean path less the way out and once more its inner leg
  std::vector<double> variance;  ///< m^2, of the path over lobe and patch
  bool known = false;

  void resize(std::size_t count) {
    for (auto* v : {&radiance, &shift, &variance}) v->resize(count);
  }
};

/// Patch that a point sees a share of, and where the middle of that is from the area's.
struct Partial {
  std::size_t patch;
  VisiblePart part;
};

/// Scratch for one evaluation, one per thread.
struct Scratch {
  std::vector<double> weight, path, variance, dx, dy, dz, cosine;
  std::vector<double> unfolded;          ///< rows of a time axis that wraps
  double* rows = nullptr;                ///< [zone][bin of the whole time axis], being rendered
  std::vector<Partial> partial;          ///< patches seen in part, in order
  std::vector<double> distance, extent;  ///< of patches, for lobes
  std::vector<LobeLight> lobes;          ///< [anchor]
  LightSums open, shaded;                ///< of some patches, for shadows in lobes
  std::vector<Sums> cells;               ///< [zone][path cell]; all zero between evaluations
  std::vector<Range> touched;            ///< [zone] path cells that hold light
  LightSums patches;                     ///< of one node, every patch by itself
  PathLight arriving, leaving;           ///< of one object point
  PathGrid::Splines splines;
  std::vector<PathLight> pairs;  ///< [zone]; dark between evaluations
  Pulses pulses;
  std::vector<double> left_u, left_v;          ///< shares of patches' edges that are seen
  std::vector<double> from_x, from_y, from_z;  ///< m, from patches' points to their middles
  LobeEnds lit_ends, seen_ends;
  double pair_count = 0;  ///< of lit and seen patches that were looked at

  void prepare(int zones, int path_cells) {
    const auto count = static_cast<std::size_t>(zones);
    if (touched.size() < count) touched.resize(count);
    const std::size_t size = count * static_cast<std::size_t>(path_cells);
    if (cells.size() < size) cells.resize(size);
    if (pairs.size() < count) pairs.resize(count);
  }
  void resize(int n) {
    const auto count = static_cast<std::size_t>(n);
    for (auto* v : {&weight, &path, &variance, &dx, &dy, &dz, &cosine}) {
      if (v->size() < count) v->resize(count);
    }
  }
};

constexpr int kNodes = 4;

/// A cell as 2 x 2 Gauss-Legendre nodes, or as its centre with a path variance from its edges.
struct CellNodes {
  std::array<SurfacePoint, kNodes> nodes;
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
};

/// Weights, with both cosines and 1/r^2, and paths between an object point and every patch.
BLINDCORNER_MULTIVERSION void exchange_paths(const SurfacePoint& cell, const PatchArrays& a,
                                             Scratch& s) {
  const int n = a.size();
  s.resize(n);
  const double qx = cell.center.x(), qy = cell.center.y(), qz = cell.center.z();
  const double mx = cell.normal.x(), my = cell.normal.y(), mz = cell.normal.z();
  const double *px = a.x.data(), *py = a.y.data(), *pz = a.z.data();
  const double *nx = a.nx.data(), *ny = a.ny.data(), *nz = a.nz.data();
  const double *weight = a.weight.data(), *leg = a.leg.data();
  double* __restrict w = s.weight.data();
  double* __restrict l = s.path.data();
  BLINDCORNER_INDEPENDENT
  for (int i = 0; i < n; ++i) {
    const double x = px[i] - qx, y = py[i] - qy, z = pz[i] - qz;
    const double r2 = x * x + y * y + z * z;
    const double at_cell = std::max(x * mx + y * my + z * mz, 0.0);
    const double at_relay = std::max(-(x * nx[i] + y * ny[i] + z * nz[i]), 0.0);
    w[i] = weight[i] * (at_cell * at_relay) / (r2 * r2);
    l[i] = leg[i] + std::sqrt(r2);
  }
}

/// Exchange between an object point and every patch: weights with both cosines and 1/r^2, paths,
/// path variances over the patch, unit directions from the cell.
BLINDCORNER_MULTIVERSION void exchange(const SurfacePoint& cell, const PatchArrays& a, Scratch& s) {
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
  BLINDCORNER_INDEPENDENT
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

/// From sums to mean path and variance.
BLINDCORNER_MULTIVERSION void normalise(Pulses& p, std::size_t count) {
  double* __restrict weight = p.weight.data();
  double* __restrict path = p.path.data();
  double* __restrict variance = p.variance.data();
  BLINDCORNER_INDEPENDENT
  for (std::size_t i = 0; i < count; ++i) {
    const double inverse = weight[i] > 0 ? 1 / weight[i] : 0;
    path[i] *= inverse;
    variance[i] = std::max(variance[i] * inverse - path[i] * path[i], 0.0);
  }
}

/// Light that comes back from where it fell, of every patch by itself: sums of weight, path and
/// path squared. `way_in` is one when both outer legs count, zero when they cancel.
BLINDCORNER_MULTIVERSION void retro_light_of_patches(const Scratch& s, const PatchArrays& a,
                                                     double scale, const Vector3d& u,
                                                     const Vector3d& v, double lobe_sigma,
                                                     double way_in, LightSums& out) {
  const double ux = u.x(), uy = u.y(), uz = u.z(), vx = v.x(), vy = v.y(), vz = v.z();
  const double *w = s.weight.data(), *l = s.path.data(), *var = s.variance.data();
  const double *dx = s.dx.data(), *dy = s.dy.data(), *dz = s.dz.data();
  const double *nx = a.nx.data(), *ny = a.ny.data(), *nz = a.nz.data();
  const double *lx = a.lx.data(), *ly = a.ly.data(), *lz = a.lz.data();
  const double *leg = a.leg.data(), *radiance = a.radiance.data();
  double* __restrict o0 = out.weight.data();
  double* __restrict o1 = out.first.data();
  double* __restrict o2 = out.second.data();
  const double lobe2 = lobe_sigma * lobe_sigma;
  const int n = a.size();
  BLINDCORNER_INDEPENDENT
  for (int i = 0; i < n; ++i) {
    const double weight = scale * w[i] * radiance[i];
    const double r = l[i] - leg[i];
    // Lobe: p scatters about r by sigma r, stretched along the tilt by 1/cos.
    const double dn = dx[i] * nx[i] + dy[i] * ny[i] + dz[i] * nz[i];
    const double cosine = std::max(-dn, 0.05);
    const double cx = way_in * lx[i] + dx[i];
    const double cy = way_in * ly[i] + dy[i];
    const double cz = way_in * lz[i] + dz[i];
    const double cn = cx * nx[i] + cy * ny[i] + cz * nz[i];
    const double cd = cx * dx[i] + cy * dy[i] + cz * dz[i];
    const double tangential2 = cx * cx + cy * cy + cz * cz - cn * cn;
    const double tilt2 = 1 - dn * dn;
    const double along2 = tilt2 > 1e-18 ? (cd - cn * dn) * (cd - cn * dn) / tilt2 : 0.0;
    const double across2 = std::max(tangential2 - along2, 0.0);
    const double lobe = lobe2 * r * r * (along2 / (cosine * cosine) + across2);
    const double gu = dx[i] * ux + dy[i] * uy + dz[i] * uz;
    const double gv = dx[i] * vx + dy[i] * vy + dz[i] * vz;
    const double path = way_in * 2 * leg[i] + 2 * r;
    o0[i] = weight;
    o1[i] = weight * path;
    o2[i] = weight * (path * path + 4 * var[i] + lobe + 4 * (gu * gu + gv * gv) / 3);
  }
}

/// From sums to mean radiance, shift of the path and its variance.
BLINDCORNER_MULTIVERSION void lobe_moments(const Scratch& s, std::size_t n, const LightSums& sums,
                                           LobeLight& light) {
  const double *w = sums.weight.data(), *first = sums.first.data(), *second = sums.second.data();
  const double *path = s.path.data(), *distance = s.distance.data();
  double* __restrict radiance = light.radiance.data();
  double* __restrict shift = light.shift.data();
  double* __restrict variance = light.variance.data();
  BLINDCORNER_INDEPENDENT
  for (std::size_t i = 0; i < n; ++i) {
    const double inverse = w[i] > 0 ? 1 / w[i] : 0.0;
    const double mean = first[i] * inverse;
    radiance[i] = w[i];
    shift[i] = w[i] > 0 ? mean - path[i] - distance[i] : 0.0;
    variance[i] = std::max(second[i] * inverse - mean * mean, 0.0);
  }
}

/// Light that comes back to a node from every patch: sums of weight, path and path squared. Both
/// legs change with a cell's half edges u and v.
BLINDCORNER_MULTIVERSION void lobe_light_of_patches(const Scratch& s, std::size_t n,
                                                    const LobeLight& light, double scale,
                                                    const Vector3d& u, const Vector3d& v,
                                                    LightSums& sums) {
  const double ux = u.x(), uy = u.y(), uz = u.z(), vx = v.x(), vy = v.y(), vz = v.z();
  const double *w = s.weight.data(), *l = s.path.data(), *distance = s.distance.data();
  const double *dx = s.dx.data(), *dy = s.dy.data(), *dz = s.dz.data();
  const double *radiance = light.radiance.data(), *shift = light.shift.data();
  const double* variance = light.variance.data();
  double* __restrict weight = sums.weight.data();
  double* __restrict first = sums.first.data();
  double* __restrict second = sums.second.data();
  BLINDCORNER_INDEPENDENT
  for (std::size_t i = 0; i < n; ++i) {
    const double gu = dx[i] * ux + dy[i] * uy + dz[i] * uz;
    const double gv = dx[i] * vx + dy[i] * vy + dz[i] * vz;
    const double path = l[i] + distance[i] + shift[i];
    const double back = scale * w[i] * radiance[i];
    weight[i] = back;
    first[i] = back * path;
    second[i] = back * (path * path + variance[i] + 4 * (gu * gu + gv * gv) / 3);
  }
}

/// Adds pulses to the two nearest of `count` path cells, each in proportion to nearness and with
/// moments about the cell's own path, against cancellation. Widens `touched` by the cells used.
BLINDCORNER_MULTIVERSION void add_to_cells(const Pulses& p, std::size_t begin, std::size_t end,
                                           double cells_per_metre, int count, Sums* cells,
                                           Range& touched) {
  constexpr std::size_t kChunk = 64;
  alignas(64) std::array<double, kChunk> near0, near1, near2, far0, far1, far2;
  alignas(64) std::array<std::int32_t, kChunk> cell, inside;
  const double step = 1 / cells_per_metre;
  const double last = count - 1;
  Range range = touched;
  for (; begin < end; begin += kChunk) {
    const std::size_t pulses = std::min(kChunk, end - begin);
    const double *weight = p.weight.data() + begin, *path = p.path.data() + begin,
                 *variance = p.variance.data() + begin;
    BLINDCORNER_INDEPENDENT
    for (std::size_t i = 0; i < pulses; ++i) {
      const double position = path[i] * cells_per_metre + kCellMargin;
      const bool counts = weight[i] > 0 && position >= 0 && position < last;
      const auto before = static_cast<std::int32_t>(counts ? position : -1.0);
      const double share = position - before;
      const double offset = share * step;
      const double behind = offset - step;
      near0[i] = weight[i] * (1 - share);
      near1[i] = near0[i] * offset;
      near2[i] = near0[i] * (offset * offset + variance[i]);
      far0[i] = weight[i] * share;
      far1[i] = far0[i] * behind;
      far2[i] = far0[i] * (behind * behind + variance[i]);
      cell[i] = before;
    }
    std::size_t used = 0;
    for (std::size_t i = 0; i < pulses; ++i) {
      inside[used] = static_cast<std::int32_t>(i);
      used += cell[i] >= 0 ? 1 : 0;
    }
    for (std::size_t k = 0; k < used; ++k) {
      const auto i = static_cast<std::size_t>(inside[k]);
      const std::int32_t c = cell[i];
      range = {std::min(range.begin, c), std::max(range.end, c + 2)};
      Sums& a = cells[c];
      a.weight += near0[i];
      a.first += near1[i];
      a.second += near2[i];
      Sums& b = cells[c + 1];
      b.weight += far0[i];
      b.first += far1[i];
      b.second += far2[i];
    }
  }
  touched = range;
}

/// Hidden objects that stand in the way of light, wherever the pose puts them: flat faces, and
/// round bodies by the silhouettes that a point sees of them.
class MovingBodies {
 public:
  bool empty() const { return faces_.empty() && spheres_.empty() && cylinders_.empty(); }

  void add(const HiddenObject& object, const Placement& placement) {
    const Transform T = object_to_world(object.shape, object.anchor, placement);
    const double size = placement.size;
    if (const auto* sphere = std::get_if<SphereShape>(&object.shape)) {
      spheres_.push_back({T.translation(), size * sphere->radius, 0});
    } else if (const auto* cylinder = std::get_if<CylinderShape>(&object.shape)) {
      cylinders_.push_back({T.translation(), size * cylinder->radius, size * cylinder->height / 2});
    } else {
      const auto* mesh = std::get_if<MeshShape>(&object.shape);
      const bool closed =
          std::holds_alternative<BoxShape>(object.shape) || (mesh != nullptr && mesh->mesh->closed);
      for (const auto& quad : flat_faces(object.shape, T, size)) faces_.push_back({quad, closed});
    }
  }

  /// Adds the faces that hide what lies behind the bodies from a point outside of them.
  void faces_seen_from(const Vector3d& point, std::vector<OccluderFace>& faces) const {
    faces.insert(faces.end(), faces_.begin(), faces_.end());
    for (const Round& sphere : spheres_) add_disc(sphere, point, faces);
    for (const Round& cylinder : cylinders_) add_side(cylinder, point, faces);
  }

 private:
  struct Round {
    Vector3d center;
    double radius, half_height;
  };

  /// The circle in which the cone of tangents touches the sphere, as an octagon of the same area.
  static void add_disc(const Round& sphere, const Vector3d& point,
                       std::vector<OccluderFace>& faces) {
    const Vector3d way = sphere.center - point;
    const double share = std::pow(sphere.radius, 2) / way.squaredNorm();
    if (share >= 1) return;
    const double reach =
        sphere.radius * std::sqrt(1 - share) * std::sqrt(kPi / (2 * std::numbers::sqrt2));
    const Vector3d u = way.unitOrthogonal();
    const Vector3d v = way.normalized().cross(u);
    std::array<Vector3d, 8> corners;
    for (std::size_t k = 0; k < 8; ++k) {
      const double angle = kPi / 4 * (static_cast<double>(k) + 0.5);
      corners[k] = point + (1 - share) * way + reach * (std::cos(angle) * u + std::sin(angle) * v);
    }
    faces.push_back({{corners[0], corners[1], corners[2], corners[3]}, false});
    faces.push_back({{corners[0], corners[3], corners[4], corners[7]}, false});
    faces.push_back({{corners[4], corners[5], corners[6], corners[7]}, false});
  }

  /// The upright rectangle between the tangents to the cylinder's side; what its caps hide besides,
  /// seen from above or below, is left out.
  static void add_side(const Round& cylinder, const Vector3d& point,
                       std::vector<OccluderFace>& faces) {
    Vector3d way = cylinder.center - point;
    way.z() = 0;
    const double share = std::pow(cylinder.radius, 2) / way.squaredNorm();
    if (!(share < 1)) return;
    const Vector3d across =
        cylinder.radius * std::sqrt(1 - share) * Vector3d(-way.y(), way.x(), 0).normalized();
    const Vector3d up(0, 0, cylinder.half_height);
    const Vector3d center = cylinder.center - share * way;
    faces.push_back(
        {{center - across - up, center + across - up, center + across + up, center - across + up},
         false});
  }

  std::vector<OccluderFace> faces_;
  std::vector<Round> spheres_, cylinders_;
};

class FastModel final : public ForwardModel {
 public:
  FastModel(const Scene& scene, const SensorPlacement& placement, const FastModelOptions& options);

  using ForwardModel::three_bounce;
  void three_bounce(const PoseVector& pose, HistogramCube& out) const override {
    render(place(scene_.hidden.placement, scene_.unknowns, pose), {}, out);
  }
  /// The same for a placement of the object, with other bodies in the way.
  void render(const Placement& placement, const MovingBodies& bodies, HistogramCube& out) const;
  const HistogramCube& direct_return() const override;
  const TransportPlan& plan() const override { return plan_; }
  std::optional<Fidelity> fidelity() const override { return fidelity_; }
  std::optional<ModelSize> size() const override {
    return ModelSize{lit_.size(), seen_.size(), object_nodes_};
  }

 private:
  using Shadows = std::vector<ShadowView>;  // one per node; empty without occluders

  struct Limits {
    double spread;        ///< m, path spread that one Gaussian may stand for
    double aspect;        ///< edge against distance of a cell with Gauss nodes
    double midpoint;      ///< the same where the centre alone will do
    double rule_spread;   ///< m, standard deviation of the path between two points of a rule
    double relay_angle;   ///< distance of two points of a rule against how far away they are
    double object_angle;  ///< the same of the object
  };
  Limits limits(double tolerance, double coarseness) const;
  void choose_fidelity(const FastModelOptions& options);
  double choose_sampling(const std::vector<PoseVector>& poses, double tolerance);
  void compare_with_pairs(const std::vector<PoseVector>& poses, double tolerance);
  void take_pairs(const std::string& reason);
  bool single_sum() const { return plan_.kernel == Kernel::retro_single; }
  double pair_count() const { return 1.0 * lit_.size() * seen_.size() * object_nodes_; }
  bool pairs_resolve_lobe(double coarseness, double tolerance) const;
  bool too_many_pairs(double most) const;
  bool arrives_at_once(double tolerance) const;
  void decide_bounces(double tolerance);
  struct Choice {
    double coarseness;
    double change;  ///< of a bin by going on to twice as many cells, as a share of the peak
  };
  Choice coarsest(const std::vector<PoseVector>& poses, double tolerance, double most_pairs,
                  const std::function<int(double)>& sample);
  std::vector<PoseVector> probe_poses() const;
  static double largest_change(const std::vector<HistogramCube>& coarse,
                               const std::vector<HistogramCube>& fine);
  void complete_plan(double tolerance);
  double single_sum_bound() const;
  std::pair<int, int> reachable_bins() const;
  void sample_relay(const Limits& limits, double tolerance);
  void sample_object(const Limits& limits);
  /// Whether any seen patch may lie on the front side of an object point.
  bool faces_relay(const Vector3d& center, const Vector3d& normal) const {
    return std::any_of(seen_.blocks.begin(), seen_.blocks.end(), [&](const auto& block) {
      return normal.dot(block.center - center) > -block.radius;
    });
  }
  void lambertian(const SurfacePoint& point, const ShadowView* shadows, Scratch& s) const;
  void pair_with_one(double scale, Scratch& s) const;
  void all_pairs(double scale, Scratch& s) const;
  void retro_single(const CellNodes& cell, std::size_t anchor, const Shadows& shadows,
                    std::span<const std::vector<OccluderFace>> occluders, Scratch& s) const;
  void sample_anchors(double edge);
  std::vector<SurfacePoint> anchors_of(const std::vector<SurfaceCell>& cells) const;
  void inner_legs(Scratch& s) const;
  LobeRays lobe_rays(const Vector3d& normal, const Scratch& s) const;
  void for_each_zone(const std::function<void(int, std::size_t, std::size_t)>& visit) const;
  void gather(const SurfacePoint& anchor, LobeLight& light, Scratch& s) const;
  void shade_lobes(const SurfacePoint& node, const std::vector<OccluderFace>& occluders,
                   Scratch& s) const;
  static void shade_patch(std::size_t i, std::size_t patch, Scratch& s);
  void see_ends(const SurfacePoint& node, const PatchArrays& a, const ShadowView* shadows,
                const CellNodes& cell, Scratch& s, LobeEnds& ends) const;
  void retro_pairs(const CellNodes& cell, const Shadows& shadows, Scratch& s) const;
  void light_between(const SurfacePoint& node, const PatchArrays& arrays, const ShadowView* shadows,
                     Scratch& s) const;
  void shade_patches(const SurfacePoint& node, const PatchArrays& arrays, const ShadowView* shadows,
                     Scratch& s) const;
  void shade(const SurfacePoint& node, const PatchArrays& arrays, const ShadowView& shadows,
             int patch, Scratch& s) const;
  static Scratch& own_scratch();  ///< of the thread
  void add_pulses(Scratch& s, int zone, std::size_t begin, std::size_t end) const;
  void add_seen_pulses(Scratch& s) const;
  void flush(Scratch& s) const;
  void render_points(const Placement& placement, const Transform& T,
                     const std::vector<OccluderFace>& occluders, const MovingBodies& bodies,
                     Scratch& s) const;
  void render_cells(const Placement& placement, const Transform& T,
                    const std::vector<OccluderFace>& occluders, const MovingBodies& bodies,
                    Scratch& s) const;
  std::vector<OccluderFace> own_occluders(const Placement& placement, const Transform& T) const;

  Scene scene_;
  PlanOverrides overrides_;
  RelaySetup setup_;
  TransportPlan plan_;
  std::vector<OccluderFace> all_occluders_;  ///< for poses outside of the search region
  std::optional<LobeField> lobe_;            ///< of the single sum
  bool confocal_;
  double pulse_sigma_;     ///< m of path, pulse, bin and extra blur together
  double extra_variance_;  ///< s^2
  bool bounces_ = false;   ///< light that bounces on within the known scene matters
  double object_edge_ = 1.0;
  int dim_patches_ = 0;   ///< left out
  int object_nodes_ = 0;  ///< of the scene's own placement
  /// [cell] which anchor's lobes stand for its own: cells near each other on one side of the
  /// object.
  std::vector<std::size_t> anchor_;
  std::size_t anchors_ = 0;
  double near_share_ = 1;         ///< of all pairs of patches: those within a lobe's reach
  double unresolved_ = 0;         ///< change of a bin where the search for a sampling gave up
  bool object_midpoint_ = false;  ///< cells are so small that their centres will do
  Fidelity fidelity_;
  PulseTable pulses_;
  std::optional<PathGrid> grid_;      ///< of a Lambertian object
  bool one_arrival_ = false;          ///< all light of a lit set reaches a point of it at once
  std::vector<SurfacePoint> points_;  ///< of a Lambertian object, in its own coordinates
  mutable std::once_flag direct_once_;
  mutable HistogramCube direct_;
  PatchArrays lit_;    ///< of the flash field, or of all zones one after the other (confocal)
  PatchArrays seen_;   ///< of all zones, one after the other
  PatchArrays relay_;  ///< what is lit, then what is seen
  int axis_bins_;
  double bins_per_metre_;
  double cells_per_metre_;
  int path_cells_;
};

/// Largest standard deviation of a pulse's path, in those of the sensor's own pulse. Points of a
/// rule have none, sampling keeps that of a group of patches below two; a lobe on a grazing relay
/// spreads paths of its own.
double widest_blur(const TransportPlan& plan) {
  switch (plan.kernel) {
    case Kernel::lambertian:
      return 0;
    case Kernel::retro_single:
      return 6;
    case Kernel::retro_pairs:
      break;
  }
  return 2;
}

FastModel::FastModel(const Scene& scene, const SensorPlacement& placement,
                     const FastModelOptions& options)
    : scene_(scene),
      overrides_(options.overrides),
      setup_(scene_, placement),
      plan_(make_plan(scene_, setup_.relay_points(), setup_.lit_extent(), overrides_)),
      all_occluders_(occluder_faces(scene_.surfaces)),
      confocal_(scene.sensor.illumination == Illumination::confocal),
      pulse_sigma_(kSpeedOfLight * std::hypot(scene.sensor.response.core_sigma(),
                                              scene.sensor.bin_width / std::sqrt(12.0),
                                              options.extra_pulse_sigma)),
      extra_variance_(options.extra_pulse_sigma * options.extra_pulse_sigma),
      pulses_(scene.sensor.response, scene.sensor.bin_width,
              extra_variance_ + std::pow(widest_blur(plan_) * pulse_sigma_ / kSpeedOfLight, 2),
              1e-4),
      axis_bins_(unwrapped_bins(scene.sensor)),
      bins_per_metre_(1 / (kSpeedOfLight * scene.sensor.bin_width)),
      cells_per_metre_(1 / (kPathCell * pulse_sigma_)),
      path_cells_(static_cast<int>(axis_bins_ / bins_per_metre_ * cells_per_metre_) +
                  2 * kCellMargin) {
  if (plan_.kernel == Kernel::retro_single && !setup_.uses_points()) {
    lobe_.emplace(scene_, placement);
  }
  if (plan_.kernel == Kernel::lambertian) {
    // Counted from the relay, legs are short by the way from it.
    double way_back = 0;
    if (scene.sensor.path_origin == PathOrigin::relay) {
      for (const Vector3d& p : setup_.relay_points()) {
        way_back = std::max(way_back, (p - setup_.origin()).norm());
      }
    }
    one_arrival_ = arrives_at_once(options.tolerance);
    grid_.emplace(scene.sensor, one_arrival_ ? PathGrid::Paths::whole : PathGrid::Paths::legs,
                  extra_variance_, axis_bins_, way_back, options.tolerance);
  }
  choose_fidelity(options);
  complete_plan(options.tolerance);
  decide_bounces(options.tolerance);
}

/// Decisions that need the sampled relay.
void FastModel::complete_plan(double tolerance) {
  decide_view(plan_, scene_, setup_.view_hull());

  PlanDecision dim{Term::dim_patches, "dim relay patches", false, "", kDimBound * tolerance};
  dim.reason = std::to_string(dim_patches_) + " of " +
               std::to_string(dim_patches_ + lit_.size() + seen_.size()) +
               " relay patches exchange less than " + text_of(kNegligible * tolerance) +
               " of the light with the search region";
  plan_.decide(dim);
  if (plan_.kernel == Kernel::lambertian) {
    PlanDecision pairs = plan_.decision(Term::patch_pairs);
    pairs.reason += one_arrival_ ? ", one of which arrives at once" : ", which are convolved";
    pairs.reason += " on a grid of paths with a step of " + text_of(1e3 * grid_->step()) + " mm";
    pairs.bound = tolerance;
    plan_.decide(pairs);
  } else {
    PlanDecision pairs = plan_.decision(Term::patch_pairs);
    // Pairs also divide the relay by the lobe: what coarser patches err by, the search's last
    // change and as much again for what it would go on to.
    pairs.bound = single_sum_bound() + std::max(tolerance, 2 * unresolved_);
    plan_.decide(pairs);
  }
  const auto [first, last] = reachable_bins();
  plan_.decide({Term::whole_axis, "bins that no light can reach", false,
                "light from the search region arrives in bins " + std::to_string(first) + " to " +
                    std::to_string(last) + " of " + std::to_string(axis_bins_)});
  const bool direct = scene_.linear.direct != LinearMode::fixed || scene_.linear.fixed_direct > 0;
  plan_.decide({Term::direct_return, "direct return of the known surfaces", direct,
                direct ? "captures hold it: computed once, it does not depend on the pose"
                       : "captures hold none"});
}

/// What one pulse, of the right mean and of the variance that two points of the lobe give, leaves
/// out of the light that a lobe gathers on the tilted relay, relative to the pulse's peak.
///
/// Turned by z standard deviations along the tilt (angle t off the normal, lobe s, distance r), the
/// lobe meets the relay a way x = r s z / cos t (1 + s tan t z + ...) off, and the path changes by
/// a z + b z^2 with a = r s / cos t times the path's gradient and b = a s tan t. The two points
/// miss the variance 2 b^2, which lowers the peak of a pulse of width w by b^2 / w^2; a Gaussian
/// misses the third cumulant k = 6 a^2 b + 8 b^3, by max |He3 phi| / phi(0) k / (6 w^3) = 0.23 k /
/// w^3. An edge that cuts the lobe makes it lopsided besides: at most k = 0.22 a^3, of a half
/// normal distribution. Oblique edges that meet lose 0.03 of the lobe at the corner.
struct LobeClosure {
  double smooth;   ///< of all light
  double at_edge;  ///< of light within a footprint of an edge

  LobeClosure(double a, double bend, double pulse) {
    const double b = a * std::min(bend, 1.0);
    const double w = std::sqrt(pulse * pulse + a * a);
    const auto skew = [&](double k) { return 0.23 * k / (w * w * w); };
    smooth = std::min(b * b / (w * w) + skew(6 * a * a * b + 8 * b * b * b), 1.0);
    at_edge = std::min(skew(0.22 * a * a * a) + 0.03, 1.0);
  }
};

/// Largest change of a bin, as a share of the peak, when pairs of patches replace the single sum:
/// what LobeClosure leaves out, averaged over each zone's light and relative to the brightest
/// zone's, at the worst of the probed placements. Edges count for the share of a bin's light within
/// a footprint on either side of two edges; a bin sees the share kBinShare of the lit spot.
double FastModel::single_sum_bound() const {
  const auto* retro = std::get_if<RetroreflectiveMaterial>(&scene_.hidden.material);
  const double extent = setup_.lit_extent();
  if (retro == nullptr || extent <= 0) return 0.0;
  constexpr double kBinShare = 0.12;  // a pulse of 4 cm of path on a spot of 0.6 m: 0.07 to 0.3
  const double sigma = retro->lobe_sigma;
  double bound = 0;
  std::vector<double> light(scene_.sensor.zones.size());
  std::vector<double> lost(light.size());
  for (const Placement& p : probe_placements(scene_)) {
    const Vector3d q = object_to_world(scene_.hidden.shape, scene_.hidden.anchor, p).translation();
    std::fill(light.begin(), light.end(), 0.0);
    std::fill(lost.begin(), lost.end(), 0.0);
    for (int i = 0, group = 0; i < seen_.size(); ++i) {
      while (i >= seen_.group_end[static_cast<std::size_t>(group)]) ++group;
      const Vector3d way = q - seen_.center(i);
      const double r = way.norm();
      const Vector3d normal = seen_.normal(i);
      const double cosine = std::max(way.dot(normal) / r, 0.5 * sigma);
      if (way.dot(normal) <= 0) continue;
      const auto k = static_cast<std::size_t>(i);
      const double weight = seen_.weight[k] * seen_.radiance[k] * cosine / (r * r);
      // Along the tilt, on the relay.
      const Vector3d tilt = way / r - normal * way.dot(normal) / r;
      const double sine = tilt.norm();
      const Vector3d gradient = seen_.leg_direction(i) - way / r;
      const double slope = sine > 0 ? std::abs(gradient.dot(tilt)) / sine : 0.0;
      const double footprint = sigma * r / cosine;
      const LobeClosure closure(footprint * slope, sigma * sine / cosine, pulse_sigma_);
      const double near_edges = std::min(4 * footprint / (kBinShare * extent), 1.0);
      const auto zone = static_cast<std::size_t>(seen_.group_zone[static_cast<std::size_t>(group)]);
      light[zone] += weight;
      lost[zone] += weight * (closure.smooth + near_edges * closure.at_edge);
    }
    const double brightest = *std::max_element(light.begin(), light.end());
    if (brightest > 0) {
      bound = std::max(bound, *std::max_element(lost.begin(), lost.end()) / brightest);
    }
  }
  return bound;
}

/// First and last bin of any zone that light from the search region can reach, by the shortest and
/// longest paths by way of a ball around each probed placement.
std::pair<int, int> FastModel::reachable_bins() const {
  double square = 0;
  double radius = 0;
  for (const Unknown& unknown : scene_.unknowns) {
    if (unknown.component <= Component::z) square += std::pow(unknown.range() / 4, 2);
  }
  for (const Placement& p : probe_placements(scene_)) {
    radius = std::max(radius, p.size * bounding_radius(scene_.hidden.shape, Anchor::center));
  }
  radius += std::sqrt(square);
  const auto legs = [&](const PatchArrays& a, const Vector3d& q) {
    std::pair<double, double> range{std::numeric_limits<double>::infinity(), 0};
    for (int i = 0; i < a.size(); ++i) {
      const double path = a.leg[static_cast<std::size_t>(i)] + (a.center(i) - q).norm();
      const double slack = radius + 2 * (a.half_u(i).norm() + a.half_v(i).norm());
      range = {std::min(range.first, path - slack), std::max(range.second, path + slack)};
    }
    return range;
  };
  double shortest = std::numeric_limits<double>::infinity();
  double longest = 0;
  for (const Placement& p : probe_placements(scene_)) {
    const Vector3d q = object_to_world(scene_.hidden.shape, scene_.hidden.anchor, p).translation();
    const auto out = legs(seen_, q);
    const auto in = lit_.size() > 0 ? legs(lit_, q) : out;
    shortest = std::min(shortest, in.first + out.first);
    longest = std::max(longest, in.second + out.second);
  }
  if (!(shortest < longest)) return {0, -1};
  const auto [early, late] = std::ranges::minmax(scene_.sensor.zones, {}, &Zone::time_zero);
  const double bin = scene_.sensor.bin_width;
  const int first = pulses_.reach(early.time_zero / bin + shortest * bins_per_metre_).first;
  const int end = pulses_.reach(late.time_zero / bin + longest * bins_per_metre_).second;
  return {std::clamp(first, 0, axis_bins_), std::clamp(end, 0, axis_bins_) - 1};
}

/// Made when somebody asks: models that only score never do.
const HistogramCube& FastModel::direct_return() const {
  std::call_once(direct_once_, [this] {
    const Sensor& sensor = scene_.sensor;
    direct_ = HistogramCube(sensor.rows, sensor.columns, sensor.bins);
    if (scene_.linear.direct == LinearMode::fixed && scene_.linear.fixed_direct == 0) return;
    const PulseTable tails(sensor.response, sensor.bin_width,
                           std::pow(sensor.response.core_sigma(), 2), 1e-7);
    direct_ = setup_.direct_return(tails, 10, true);
    if (bounces_) StaticBounces(scene_, setup_, kBounces).add(nullptr, direct_);
    mix_zones(sensor, direct_);
  });
  return direct_;
}

/// Whether the known scene's own two- and three-bounce light matters beside the object's.
void FastModel::decide_bounces(double tolerance) {
  const Sensor& sensor = scene_.sensor;
  const auto decide = [&](bool used, const std::string& reason, double bound = 0) {
    bounces_ = overrides_.switched_on(Term::known_bounces) ||
               (used && !overrides_.switched_off(Term::known_bounces));
    plan_.decide({Term::known_bounces, "two and three bounces within the known scene", used, reason,
                  used ? 0.0 : bound});
  };
  if (scene_.linear.direct == LinearMode::fixed && scene_.linear.fixed_direct == 0) {
    return decide(false, "captures hold no light of the known scene");
  }
  const StaticBounces bounces(scene_, setup_, kBouncesEstimate);
  if (!bounces.any()) return decide(false, "no two reflecting surfaces face each other");
  HistogramCube light(sensor.rows, sensor.columns, sensor.bins);
  bounces.add(nullptr, light);
  double brightest = 0;
  HistogramCube object;
  for (const PoseVector& pose : probe_poses()) {
    three_bounce(pose, object);
    brightest = std::max(brightest, *std::max_element(object.values.begin(), object.values.end()));
  }
  const double share =
      *std::max_element(light.values.begin(), light.values.end()) / std::max(brightest, 1e-300);
  char text[96];
  std::snprintf(text, sizeof text, "its peak is about %.2g of the object's, the tolerance is %.2g",
                share, tolerance);
  decide(share > kBouncesMatter * tolerance, text, tolerance);
}

/// Edge of what shares the lobes of its middle, in those for which a midpoint will do: lobes matter
/// at the edges of the light only.
constexpr double kAnchorEdge = 2;
/// Cosine between normals of cells on one side of the object.
constexpr double kSameSide = 0.9;

/// Limits of sampling in units of those that the closed-form estimates give for the tolerance.
FastModel::Limits FastModel::limits(double tolerance, double coarseness) const {
  // Six axes share each limit: two each of what is lit, what is seen and the object.
  constexpr double kAxes = 6;
  Limits l;
  l.spread =
      coarseness * pulse_sigma_ * std::pow(tolerance / kClosureError, 0.25) / std::sqrt(kAxes);
  l.aspect = coarseness * std::pow(tolerance / kQuadratureError / kAxes, 0.25);
  l.midpoint = coarseness * std::sqrt(tolerance / kMidpointError);
  const double digits = std::log(1 / tolerance);
  l.rule_spread = coarseness * kRuleSpread * pulse_sigma_ / std::sqrt(digits);
  l.relay_angle = coarseness * kRelayRuleAngle / digits;
  l.object_angle = coarseness * kObjectRuleAngle / digits;
  if (plan_.kernel == Kernel::retro_pairs) {
    // A patch stands for a Gaussian within the lobe: it must not be wide against it.
    const double sigma = std::get<RetroreflectiveMaterial>(scene_.hidden.material).lobe_sigma;
    l.aspect = std::min(l.aspect, coarseness * kLobePatch * sigma);
  }
  return l;
}

/// The cheapest sampling that meets the tolerance: limits become stricter until going on to at
/// least twice as many cells would change no bin of any probed pose by more than the tolerance (of
/// the pose's peak). The error falls with the fourth power of a cell's edges, so the change is at
/// least three quarters of the coarser one's error. The object takes half of the tolerance at most,
/// the relay what that leaves. Returns the change of both.
double FastModel::choose_sampling(const std::vector<PoseVector>& poses, double tolerance) {
  const auto object = [&](double c) {
    sample_object(limits(tolerance, c));
    return object_nodes_;
  };
  const auto relay = [&](double c) {
    sample_relay(limits(tolerance, c), tolerance);
    return lit_.size() + seen_.size();
  };
  // Pairs err by the object's cells the same at a coarser relay.
  fidelity_.relay = plan_.kernel == Kernel::retro_pairs ? 4 : 2;
  relay(fidelity_.relay);
  object(kCoarsest);
  // Half of the time is left for a finer relay.
  while (too_many_pairs(0.5 * kMostPairs) && fidelity_.relay < kCoarsest) {
    fidelity_.relay *= kCoarsenessStep;
    relay(fidelity_.relay);
    object(kCoarsest);
  }
  const Choice chosen = coarsest(poses, 0.5 * tolerance, 0.5 * kMostPairs, object);
  fidelity_.object = chosen.coarseness;
  object(fidelity_.object);
  const double left = tolerance - std::min(chosen.change, 0.5 * tolerance);
  const auto resolved_relay = [&](double c) {
    const int cells = relay(c);
    return pairs_resolve_lobe(c, tolerance) ? cells : -1;
  };
  const Choice last = coarsest(poses, left, kMostPairs, resolved_relay);
  fidelity_.relay = last.coarseness;
  relay(fidelity_.relay);
  return chosen.change + last.change;
}

/// A sampling for the plan's kernel, and pairs instead of the single sum where that leaves out too
/// much.
void FastModel::choose_fidelity(const FastModelOptions& options) {
  if (options.fidelity) {
    fidelity_ = *options.fidelity;
    // Of several objects, some may have no lobe.
    const bool wanted = fidelity_.lobe_pairs && !overrides_.switched_off(Term::patch_pairs);
    if (wanted && single_sum() && lobe_) take_pairs("; pairs, as the fidelity given says");
    sample_relay(limits(options.tolerance, fidelity_.relay), options.tolerance);
    sample_object(limits(options.tolerance, fidelity_.object));
    return;
  }
  const std::vector<PoseVector> poses = probe_poses();
  choose_sampling(poses, options.tolerance);
  if (single_sum() && lobe_ && !overrides_.switched_off(Term::patch_pairs)) {
    compare_with_pairs(poses, options.tolerance);
  }
}

/// Pairs of patches instead of the single sum.
void FastModel::take_pairs(const std::string& reason) {
  plan_.kernel = Kernel::retro_pairs;
  fidelity_.lobe_pairs = true;
  PlanDecision decision = plan_.decision(Term::patch_pairs);
  decision.used = true;
  decision.reason += reason;
  plan_.decide(decision);
}

/// Looks at what the single sum leaves out, first at a coarse sampling of pairs, and where that may
/// be more than the tolerance at one that meets it: takes pairs where it is.
void FastModel::compare_with_pairs(const std::vector<PoseVector>& poses, double tolerance) {
  constexpr Fidelity kCoarsePairs{4, kCoarsest, true};
  const auto light = [&] {
    std::vector<HistogramCube> cubes;
    double pairs = 0;
    for (const PoseVector& pose : poses) {
      cubes.push_back(three_bounce(pose));
      pairs = std::max(pairs, own_scratch().pair_count);
    }
    if (!single_sum()) near_share_ = pairs / std::max(pair_count(), 1.0);
    return cubes;
  };
  const Fidelity single = fidelity_;
  const TransportPlan plan = plan_;
  const double unresolved = unresolved_;
  if (single_sum_bound() < 0.5 * tolerance) return;
  const std::vector<HistogramCube> summed = light();

  fidelity_ = kCoarsePairs;
  take_pairs("");
  sample_relay(limits(tolerance, fidelity_.relay), tolerance);
  sample_object(limits(tolerance, fidelity_.object));
  double change = largest_change(summed, light());
  if (change > tolerance) {
    unresolved_ = 0;
    // Of two errors that have nothing to do with each other, the sum's. What a search gave up on is
    // the change of a sampling with at most half of the cells that it took.
    const double own = std::max(choose_sampling(poses, tolerance), 0.5 * unresolved_);
    const double both = largest_change(summed, light());
    change = std::sqrt(std::max(both * both - own * own, 0.0));
  }
  plan_ = plan;
  if (change > tolerance) {
    take_pairs("; one sum would change a bin by " + text_of(change));
    return;
  }
  PlanDecision decision = plan_.decision(Term::patch_pairs);
  decision.reason += "; pairs would change a bin by no more than the tolerance";
  plan_.decide(decision);
  fidelity_ = single;
  unresolved_ = unresolved;
  sample_relay(limits(tolerance, fidelity_.relay), tolerance);
  sample_object(limits(tolerance, fidelity_.object));
}

/// Whether pairs see an even relay as even. A row of normal distributions, each as wide as a patch
/// of edge w and the lobe together, has ripples of 2 exp(-2 pi^2 (sigma^2 + w^2 / 12) / w^2); each
/// seen patch and object point sees another phase of them.
bool FastModel::pairs_resolve_lobe(double coarseness, double tolerance) const {
  if (plan_.kernel != Kernel::retro_pairs) return true;
  const double edge = coarseness * kLobePatch;  // in units of the lobe
  const double ripple = 2 * std::exp(-2 * kPi * kPi * (1 / (edge * edge) + 1.0 / 12));
  const auto seen = static_cast<double>(seen_.group_end.size()) / scene_.sensor.zone_count();
  return ripple < tolerance * std::sqrt(std::max(seen * object_nodes_, 1.0));
}

/// Whether pairs of patches, where they are needed, would take too long.
bool FastModel::too_many_pairs(double most) const {
  return plan_.kernel == Kernel::retro_pairs && near_share_ * pair_count() > most;
}

/// Whether paths of light that arrives differ by so little that their mean will do: without their
/// variance a pulse's peak errs by half of it over the pulse's own. Of every lit set and probed
/// placement.
bool FastModel::arrives_at_once(double tolerance) const {
  const double pulse = std::pow(kSpeedOfLight * scene_.sensor.response.core_sigma(), 2);
  RelaySampling coarse;
  coarse.divisions = 4;
  coarse.edge_depth = 2;
  std::vector<std::vector<WeightedPatch>> sets;
  if (confocal_) {
    for (int z = 0; z < scene_.sensor.zone_count(); ++z) {
      if (scene_.sensor.zones[static_cast<std::size_t>(z)].dead) continue;
      sets.push_back(setup_.lit_by_zone(z, coarse));
    }
  } else {
    sets.push_back(setup_.lit(coarse));
  }
  for (const Placement& p : probe_placements(scene_)) {
    const Vector3d q = object_to_world(scene_.hidden.shape, scene_.hidden.anchor, p).translation();
    for (const std::vector<WeightedPatch>& set : sets) {
      double weight = 0, first = 0, second = 0;
      for (const WeightedPatch& patch : set) {
        const Vector3d way = patch.patch.center - q;
        const double path = patch.leg + way.norm();
        const Vector3d gradient = patch.leg_direction + way.normalized();
        const double variance = (std::pow(gradient.dot(patch.patch.half_u), 2) +
                                 std::pow(gradient.dot(patch.patch.half_v), 2)) /
                                3;
        weight += patch.weight;
        first += patch.weight * path;
        second += patch.weight * (path * path + variance);
      }
      if (weight <= 0) continue;
      const double variance = second / weight - std::pow(first / weight, 2);
      if (0.5 * variance > PathGrid::kShare * tolerance * pulse) return false;
    }
  }
  return true;
}

/// `sample` takes a coarseness and returns how many cells it made, -1 if they are too coarse to
/// be looked at.
FastModel::Choice FastModel::coarsest(const std::vector<PoseVector>& poses, double tolerance,
                                      double most_pairs, const std::function<int(double)>& sample) {
  // Borders of surfaces and shadows converge slowly: below this, finer cells that gain next to
  // nothing are not worth their time.
  constexpr double kStagnates = 0.05;
  struct Candidate {
    double coarseness;
    int cells;
    std::vector<HistogramCube> cubes;
  };
  std::vector<Candidate> candidates;
  const bool rules = plan_.kernel == Kernel::lambertian;
  std::vector<double> changes;  // [candidate] to at least twice as many cells
  double last_skipped = 0;      // coarseness
  const double step = rules ? kRuleStep : kCoarsenessStep;
  for (double c = kCoarsest; c > (rules ? kRuleFinest : kFinest); c /= step) {
    const int cells = sample(c);
    const bool first = candidates.empty() && last_skipped == 0;
    if (!first && too_many_pairs(most_pairs)) break;
    if (cells < 0) {
      last_skipped = c;
      continue;
    }
    if (!candidates.empty() && candidates.back().cells == cells) continue;
    candidates.push_back({c, cells, std::vector<HistogramCube>(poses.size())});
    const Candidate& fine = candidates.back();
    double pairs = 0;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      three_bounce(poses[i], candidates.back().cubes[i]);
      pairs = std::max(pairs, own_scratch().pair_count);
    }
    if (plan_.kernel == Kernel::retro_pairs) near_share_ = pairs / std::max(pair_count(), 1.0);
    while (changes.size() + 1 < candidates.size()) {
      const Candidate& coarse = candidates[changes.size()];
      if (fine.cells < 2 * coarse.cells) break;
      const double change = largest_change(coarse.cubes, fine.cubes);
      if (change < tolerance) return {coarse.coarseness, change};
      const double before =
          changes.empty() ? std::numeric_limits<double>::infinity() : changes.back();
      changes.push_back(change);
      if (!rules && change < kStagnates && change > 0.8 * before) {
        unresolved_ += change;
        return {coarse.coarseness, change};
      }
    }
  }
  if (!changes.empty()) unresolved_ += changes.back();
  if (candidates.empty()) {
    unresolved_ += tolerance;
    return {last_skipped, tolerance};
  }
  return {candidates.back().coarseness, tolerance};
}

/// Poses at which errors are estimated: a low-discrepancy sequence in the search region.
std::vector<PoseVector> FastModel::probe_poses() const {
  constexpr int kPoses = 8;
  constexpr std::array<int, 6> kPrimes{2, 3, 5, 7, 11, 13};
  std::vector<PoseVector> poses;
  for (int i = 0; i < (scene_.unknowns.empty() ? 1 : kPoses); ++i) {
    PoseVector pose(static_cast<Eigen::Index>(scene_.unknowns.size()));
    for (std::size_t k = 0; k < scene_.unknowns.size(); ++k) {
      // Radical inverse (Halton).
      const int base = kPrimes[k % kPrimes.size()];
      double t = 0;
      double digit = 1.0 / base;
      for (int n = i + 1; n > 0; n /= base, digit /= base) t += digit * (n % base);
      pose[static_cast<Eigen::Index>(k)] =
          scene_.unknowns[k].lower + t * scene_.unknowns[k].range();
    }
    poses.push_back(pose);
  }
  return poses;
}

/// Largest change of a bin, relative to the peak of its pose; poses that give next to no light do
/// not count.
double FastModel::largest_change(const std::vector<HistogramCube>& coarse,
                                 const std::vector<HistogramCube>& fine) {
  constexpr double kDark = 1e-3;
  std::vector<double> peaks;
  for (const HistogramCube& cube : fine) {
    peaks.push_back(*std::max_element(cube.values.begin(), cube.values.end()));
  }
  const double brightest = *std::max_element(peaks.begin(), peaks.end());
  double largest = 0;
  for (std::size_t i = 0; i < fine.size(); ++i) {
    if (peaks[i] <= kDark * brightest) continue;
    for (std::size_t k = 0; k < fine[i].values.size(); ++k) {
      largest = std::max(largest, std::abs(coarse[i].values[k] - fine[i].values[k]) / peaks[i]);
    }
  }
  return largest;
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
/// Where rules of points do, cells are divided as little as borders of surfaces and dim parts ask
/// for, and have as many points along each edge as they exceed the limits.
void FastModel::sample_relay(const Limits& limits, double tolerance) {
  lit_ = {};
  seen_ = {};
  relay_ = {};
  std::vector<Vector3d> objects;
  for (const Placement& p : probe_placements(scene_)) {
    objects.push_back(object_to_world(scene_.hidden.shape, scene_.hidden.anchor, p).translation());
  }
  const Vector3d origin = setup_.origin();
  const bool single = plan_.kernel == Kernel::retro_single;
  const bool rules = plan_.kernel == Kernel::lambertian;
  const bool pairs = plan_.kernel == Kernel::retro_pairs;
  // How far a patch is beyond the limits along half_u and half_v.
  const auto excess = [&](const RelayPatch& patch, const Brightness& brightness) {
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
    const double spread = rules ? limits.rule_spread : limits.spread;
    const double angle = rules ? limits.relay_angle : limits.aspect;
    return std::array{
        std::max(std::sqrt(path_u / count) / spread, std::sqrt(angle_u / count) / angle) / relaxed,
        std::max(std::sqrt(path_v / count) / spread, std::sqrt(angle_v / count) / angle) / relaxed};
  };
  RelaySampling sampling;
  sampling.edge_depth = kEdgeDepth;
  const auto sample_by = [&](const Brightness& brightness) {
    sampling.split = [&](const RelayPatch& patch) {
      const double most = rules && patch.whole ? kMostRulePoints : 1.0;
      const auto [u, v] = excess(patch, brightness);
      if (std::max(u, v) <= most) return 0;
      return u >= v ? 1 : 2;
    };
    sampling.nodes = [&](const RelayPatch& patch) -> std::array<int, 2> {
      if (rules) {
        const auto [u, v] = excess(patch, brightness);
        return {std::max(static_cast<int>(std::ceil(u)), 1),
                std::max(static_cast<int>(std::ceil(v)), 1)};
      }
      const double edge = 2 * std::max(patch.half_u.norm(), patch.half_v.norm());
      const bool wide = std::any_of(objects.begin(), objects.end(), [&](const Vector3d& q) {
        return edge > limits.midpoint * (patch.center - q).norm();
      });
      return pairs || wide ? std::array{2, 2} : std::array{1, 1};
    };
  };
  // Dim parts that, with all that is up to twice as bright, hold less than this share are left out.
  // The margin is for cells dimmer than any of those whose light was learned.
  const double negligible =
      overrides_.switched_on(Term::dim_patches) ? 0.0 : kNegligible * tolerance;
  dim_patches_ = 0;
  const auto prune = [&](std::vector<WeightedPatch> patches, const Brightness& brightness) {
    dim_patches_ += static_cast<int>(std::erase_if(patches, [&](const WeightedPatch& p) {
      return brightness.share_below(2 * brightness.density(p.patch)) < negligible;
    }));
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
  sample_by(seen);
  std::vector<std::vector<WeightedPatch>> lit_sets, seen_sets;
  for (int z = 0; z < zones; ++z) {
    seen_sets.emplace_back();
    if (confocal_ && !single) lit_sets.emplace_back();
    if (!dead(z)) seen_sets.back() = prune(setup_.seen(z, sampling), seen);
    if (!dead(z) && confocal_ && !single) lit_sets.back() = setup_.lit_by_zone(z, sampling);
  }
  if (!confocal_ && !single) {
    Brightness lit(objects, false);
    coarse.divisions = 12;
    for (const WeightedPatch& p : setup_.lit(coarse)) lit.learn(p.patch);
    lit.finish();
    sample_by(lit);
    lit_sets.push_back(prune(setup_.lit(sampling), lit));
  }
  const auto fill = [](PatchArrays& arrays, const std::vector<std::vector<WeightedPatch>>& sets,
                       bool by_zone) {
    for (std::size_t i = 0; i < sets.size(); ++i) {
      arrays.append(sets[i], by_zone ? static_cast<int>(i) : -1);
    }
  };
  fill(lit_, lit_sets, confocal_);
  fill(seen_, seen_sets, true);
  if (rules) {
    fill(relay_, lit_sets, confocal_);
    fill(relay_, seen_sets, true);
  }
  for (PatchArrays* arrays : {&lit_, &seen_, &relay_}) arrays->finish();
}

/// Divides the object until its cells meet both limits, cells weighted with the light that they
/// would exchange.
void FastModel::sample_object(const Limits& limits) {
  const double extent = 2 * bounding_radius(scene_.hidden.shape, Anchor::center);
  const int stride = std::max(1, seen_.size() / 64);
  double anchor_edge = 0;
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
    object_midpoint_ = std::sqrt(angle / weight) <= limits.midpoint;
    anchor_edge = object_edge_ * kAnchorEdge * limits.midpoint / std::sqrt(angle / weight);
    const bool rules = plan_.kernel == Kernel::lambertian;
    if (std::sqrt(path / weight) <= (rules ? limits.rule_spread : limits.spread) &&
        std::sqrt(angle / weight) <= (rules ? limits.object_angle : limits.aspect)) {
      break;
    }
  }
  if (plan_.kernel == Kernel::lambertian) {
    points_ = quadrature(scene_.hidden.shape, object_edge_);
    object_nodes_ = static_cast<int>(points_.size());
    return;
  }
  const Transform T =
      object_to_world(scene_.hidden.shape, scene_.hidden.anchor, scene_.hidden.placement);
  const auto cells =
      divide(scene_.hidden.shape, T, scene_.hidden.placement.size, object_edge_, 1).size();
  object_nodes_ = static_cast<int>(cells) * (object_midpoint_ ? 1 : kNodes);
  if (single_sum() && lobe_) sample_anchors(anchor_edge);
}

/// What a lobe gathers about a patch changes slowly with the place on the object that it belongs to
/// (its footprint's size and shape, not its middle), so the middle of several cells will do for
/// them: the error is of second order in their extent over the distance.
void FastModel::sample_anchors(double edge) {
  const Transform own = Transform::Identity();
  const auto cells = divide(scene_.hidden.shape, own, 1.0, object_edge_, 1);
  const auto tiles = divide(scene_.hidden.shape, own, 1.0, std::max(edge, object_edge_), 1);
  anchor_.clear();
  anchors_ = tiles.size();
  for (const SurfaceCell& cell : cells) {
    const auto far = [&](const SurfaceCell& tile) {
      const bool turned = tile.normal.dot(cell.normal) < kSameSide;
      return std::make_pair(turned, (tile.center - cell.center).squaredNorm());
    };
    const auto nearest = std::ranges::min_element(tiles, {}, far);
    anchor_.push_back(static_cast<std::size_t>(nearest - tiles.begin()));
  }
}

/// Middles of the cells that share an anchor.
std::vector<SurfacePoint> FastModel::anchors_of(const std::vector<SurfaceCell>& cells) const {
  std::vector<SurfacePoint> anchors(anchors_, {Vector3d::Zero(), Vector3d::Zero(), 0.0});
  for (std::size_t c = 0; c < cells.size(); ++c) {
    SurfacePoint& anchor = anchors[anchor_[c]];
    anchor.center += cells[c].area * cells[c].center;
    anchor.normal += cells[c].area * cells[c].normal;
    anchor.area += cells[c].area;
  }
  for (SurfacePoint& anchor : anchors) {
    if (anchor.area > 0) anchor.center /= anchor.area;
    anchor.normal.normalize();
  }
  return anchors;
}

/// Weights, paths and directions between a node and all patches, shadows included.
void FastModel::light_between(const SurfacePoint& node, const PatchArrays& arrays,
                              const ShadowView* shadows, Scratch& s) const {
  exchange(node, arrays, s);
  shade_patches(node, arrays, shadows, s);
}

/// Takes shadows away from weights, paths and, where there are any, directions.
void FastModel::shade_patches(const SurfacePoint& node, const PatchArrays& arrays,
                              const ShadowView* shadows, Scratch& s) const {
  s.partial.clear();
  if (shadows == nullptr) return;
  for (const PatchArrays::Block& block : arrays.blocks) {
    const ShadowView::Sight sight = shadows->sight(block.center, block.radius);
    if (sight == ShadowView::Sight::clear) continue;
    if (sight == ShadowView::Sight::hidden) {
      std::fill(s.weight.begin() + block.begin, s.weight.begin() + block.end, 0.0);
      continue;
    }
    std::array<ShadowView::Sight, PatchArrays::kBlock> sights;
    shadows->sights(arrays.coordinates(), block.begin, block.end, sights.data());
    for (int i = block.begin; i < block.end; ++i) {
      const ShadowView::Sight own = sights[static_cast<std::size_t>(i - block.begin)];
      if (own == ShadowView::Sight::hidden) s.weight[static_cast<std::size_t>(i)] = 0;
      if (own == ShadowView::Sight::mixed) shade(node, arrays, *shadows, i, s);
    }
  }
}

/// Takes the shadowed part of one patch away.
void FastModel::shade(const SurfacePoint& node, const PatchArrays& arrays,
                      const ShadowView& shadows, int patch, Scratch& s) const {
  const auto k = static_cast<std::size_t>(patch);
  // What lies behind the object's surface is dark; a visible part may lie in front of it where the
  // patch's own point does not.
  const double reach = std::abs(node.normal.dot(arrays.half_u(patch))) +
                       std::abs(node.normal.dot(arrays.half_v(patch)));
  if (node.normal.dot(arrays.area_center(patch) - node.center) <= -reach) return;
  const VisiblePart part =
      shadows.see(arrays.area_center(patch), arrays.half_u(patch), arrays.half_v(patch));
  if (part.fraction >= 1) return;
  if (part.fraction <= 0) {
    s.weight[k] = 0;
    return;
  }
  s.partial.push_back({k, part});
  // The visible part's own centre.
  const Vector3d shift =
      part.shift + (1 - part.fraction) * (arrays.area_center(patch) - arrays.center(patch));
  const Vector3d way = arrays.center(patch) + shift - node.center;
  const double r = way.norm();
  const Vector3d direction = way / r;
  const double cell_cosine = std::max(direction.dot(node.normal), 0.0);
  const double relay_cosine = std::max(-direction.dot(arrays.normal(patch)), 0.0);
  s.weight[k] = part.fraction * arrays.weight[k] * cell_cosine * relay_cosine / (r * r);
  s.path[k] = arrays.leg[k] + arrays.leg_direction(patch).dot(shift) + r;
  s.variance[k] *= part.fraction * part.fraction;
  s.dx[k] = direction.x();
  s.dy[k] = direction.y();
  s.dz[k] = direction.z();
  s.cosine[k] = cell_cosine;
}

/// Pulses [begin, end) go to the cells of a zone.
void FastModel::add_pulses(Scratch& s, int zone, std::size_t begin, std::size_t end) const {
  add_to_cells(s.pulses, begin, end, cells_per_metre_, path_cells_,
               s.cells.data() + static_cast<std::ptrdiff_t>(zone) * path_cells_,
               s.touched[static_cast<std::size_t>(zone)]);
}

/// All pulses, given as sums, go to the zones of the seen groups, one for each.
void FastModel::add_seen_pulses(Scratch& s) const {
  const std::size_t groups = seen_.group_zone.size();
  normalise(s.pulses, groups);
  for (std::size_t begin = 0; begin < groups;) {
    std::size_t end = begin;
    while (end < groups && seen_.group_zone[end] == seen_.group_zone[begin]) ++end;
    add_pulses(s, seen_.group_zone[begin], begin, end);
    begin = end;
  }
}

/// One pulse for each path cell that holds light; leaves the cells empty.
void FastModel::flush(Scratch& s) const {
  for (int z = 0; z < scene_.sensor.zone_count(); ++z) {
    if (grid_) {
      PathLight& pairs = s.pairs[static_cast<std::size_t>(z)];
      if (overrides_.switched_on(Term::whole_axis)) pairs.take_all();
      grid_->add_to_row(z, pairs, s.rows + static_cast<std::ptrdiff_t>(z) * axis_bins_);
      pairs.clear();
      continue;
    }
    const double start =
        scene_.sensor.zones[static_cast<std::size_t>(z)].time_zero / scene_.sensor.bin_width;
    Sums* cells = s.cells.data() + static_cast<std::ptrdiff_t>(z) * path_cells_;
    double* row = s.rows + static_cast<std::ptrdiff_t>(z) * axis_bins_;
    Range& touched = s.touched[static_cast<std::size_t>(z)];
    if (overrides_.switched_on(Term::whole_axis)) touched = {0, path_cells_};
    for (int c = touched.begin; c < touched.end; ++c) {
      if (cells[c].weight <= 0) continue;
      const double mean = cells[c].first / cells[c].weight;
      const double variance = std::max(cells[c].second / cells[c].weight - mean * mean, 0.0);
      const double path = (c - kCellMargin) / cells_per_metre_ + mean;
      pulses_.add(row, axis_bins_, start + path * bins_per_metre_,
                  variance / (kSpeedOfLight * kSpeedOfLight) + extra_variance_, cells[c].weight);
    }
    if (touched.begin < touched.end) std::fill(cells + touched.begin, cells + touched.end, Sums{});
    touched = {};
  }
}

/// Light arriving at an object point, convolved with the light that leaves it to each zone.
void FastModel::lambertian(const SurfacePoint& point, const ShadowView* shadows, Scratch& s) const {
  const double scale = scene_.hidden.albedo / kPi * point.area;
  exchange_paths(point, relay_, s);
  shade_patches(point, relay_, shadows, s);
  if (overrides_.switched_on(Term::patch_pairs)) return all_pairs(scale, s);
  if (one_arrival_) return pair_with_one(scale, s);
  grid_->find_splines(s.path.data(), s.weight.data(), relay_.size(), s.splines);
  const std::size_t lit_sets = lit_.set_end.size();
  const std::size_t zones = seen_.set_end.size();
  const auto lay = [&](std::size_t set, PathLight& light) {
    const auto [begin, end] = relay_.set(set);
    grid_->lay(s.splines, begin, end, light);
  };
  if (!confocal_) lay(0, s.arriving);
  for (std::size_t z = 0; z < zones; ++z) {
    if (confocal_) lay(z, s.arriving);
    if (s.arriving.dark()) continue;
    lay(lit_sets + z, s.leaving);
    grid_->pair(s.arriving, s.leaving, scale, s.pairs[z]);
  }
}

/// The same where what arrives has one path: whole paths, without a convolution.
void FastModel::pair_with_one(double scale, Scratch& s) const {
  const std::size_t lit_sets = lit_.set_end.size();
  const std::size_t zones = seen_.set_end.size();
  const auto first = static_cast<std::size_t>(lit_.size());
  for (std::size_t set = 0; set < lit_sets; ++set) {
    double weight = 0, path = 0;
    const auto [in_begin, in_end] = relay_.set(set);
    for (std::size_t p = in_begin; p < in_end; ++p) {
      weight += s.weight[p];
      path += s.weight[p] * s.path[p];
    }
    if (weight > 0) path /= weight;
    // A flash lights all zones, a confocal set its own.
    const std::size_t begin = relay_.set(lit_sets + (confocal_ ? set : 0)).first;
    const std::size_t end = relay_.set(lit_sets + (confocal_ ? set : zones - 1)).second;
    for (std::size_t r = begin; r < end; ++r) {
      s.weight[r] *= scale * weight;
      s.path[r] += path;
    }
  }
  grid_->find_splines(s.path.data() + first, s.weight.data() + first, seen_.size(), s.splines);
  for (std::size_t z = 0; z < zones; ++z) {
    const auto [begin, end] = relay_.set(lit_sets + z);
    grid_->add(s.splines, begin - first, end - first, s.pairs[z]);
  }
}

/// The same without the grid: one pulse for each pair.
void FastModel::all_pairs(double scale, Scratch& s) const {
  const std::size_t lit_sets = lit_.set_end.size();
  for (std::size_t z = 0; z < seen_.set_end.size(); ++z) {
    const double start = scene_.sensor.zones[z].time_zero / scene_.sensor.bin_width;
    double* row = s.rows + static_cast<std::ptrdiff_t>(z) * axis_bins_;
    const auto [in_begin, in_end] = relay_.set(confocal_ ? z : 0);
    const auto [out_begin, out_end] = relay_.set(lit_sets + z);
    for (std::size_t r = out_begin; r < out_end; ++r) {
      for (std::size_t p = in_begin; p < in_end; ++p) {
        const double light = scale * s.weight[p] * s.weight[r];
        if (light <= 0) continue;
        pulses_.add(row, axis_bins_, start + (s.path[p] + s.path[r]) * bins_per_metre_,
                    extra_variance_, light);
      }
    }
  }
}

/// The lobe is small against the lit spot: light comes back from about where it fell. Integrating
/// the lobe over p leaves the radiance about r, and the fall-off is 1/r^2. `occluders` of each
/// node, or one list for all.
void FastModel::retro_single(const CellNodes& cell, std::size_t anchor, const Shadows& shadows,
                             std::span<const std::vector<OccluderFace>> occluders,
                             Scratch& s) const {
  const double sigma = std::get<RetroreflectiveMaterial>(scene_.hidden.material).lobe_sigma;
  // Both outer legs are the patch's own; counted from the relay they cancel.
  const double way_in = scene_.sensor.path_origin == PathOrigin::sensor ? 1 : 0;
  const std::size_t groups = seen_.group_end.size();
  const auto patches = static_cast<std::size_t>(seen_.size());
  s.patches.resize(patches);
  s.pulses.resize(groups);
  std::fill_n(s.pulses.weight.begin(), groups, 0.0);
  std::fill_n(s.pulses.path.begin(), groups, 0.0);
  std::fill_n(s.pulses.variance.begin(), groups, 0.0);
  for (std::size_t n = 0; n < cell.count; ++n) {
    const SurfacePoint& node = cell.nodes[n];
    light_between(node, seen_, shadows.empty() ? nullptr : &shadows[n], s);
    const double scale = scene_.hidden.albedo * node.area;
    if (lobe_) {
      inner_legs(s);
      lobe_light_of_patches(s, patches, s.lobes[anchor], scale, cell.half_u, cell.half_v,
                            s.patches);
      const auto& faces = occluders[std::min(n, occluders.size() - 1)];
      if (!faces.empty()) shade_lobes(node, faces, s);
    } else {
      retro_light_of_patches(s, seen_, scale, cell.half_u, cell.half_v, sigma, way_in, s.patches);
    }
    std::size_t i = 0;
    for (std::size_t g = 0; g < groups; ++g) {
      for (const auto end = static_cast<std::size_t>(seen_.group_end[g]); i < end; ++i) {
        s.pulses.weight[g] += s.patches.weight[i];
        s.pulses.path[g] += s.patches.first[i];
        s.pulses.variance[g] += s.patches.second[i];
      }
    }
  }
  add_seen_pulses(s);
}

LobeRays FastModel::lobe_rays(const Vector3d& normal, const Scratch& s) const {
  return {s.dx.data(),     s.dy.data(),     s.dz.data(),     s.distance.data(),
          s.path.data(),   s.extent.data(), seen_.lx.data(), seen_.ly.data(),
          seen_.lz.data(), seen_.ux.data(), seen_.uy.data(), seen_.uz.data(),
          seen_.vx.data(), seen_.vy.data(), seen_.vz.data(), normal};
}

/// Visits the patches that lobes may be asked about together: zone, first and one past the last.
void FastModel::for_each_zone(
    const std::function<void(int, std::size_t, std::size_t)>& visit) const {
  for (std::size_t g = 0, begin = 0; g < seen_.group_end.size();) {
    const int zone = seen_.group_zone[g];
    while (g < seen_.group_end.size() && (!confocal_ || seen_.group_zone[g] == zone)) ++g;
    const auto end = static_cast<std::size_t>(seen_.group_end[g - 1]);
    visit(zone, begin, end);
    begin = end;
  }
}

/// Clears the first `count` sums, to be added to.
LobeSums lobe_sums(LightSums& sums, std::size_t count) {
  for (auto* v : {&sums.weight, &sums.first, &sums.second}) std::fill_n(v->begin(), count, 0.0);
  return {sums.weight.data(), sums.first.data(), sums.second.data()};
}

/// Inner legs of the ways out in `s`.
void FastModel::inner_legs(Scratch& s) const {
  s.distance.resize(static_cast<std::size_t>(seen_.size()));
  for (std::size_t i = 0; i < s.distance.size(); ++i) s.distance[i] = s.path[i] - seen_.leg[i];
}

/// What lobes about all patches gather, without occluders.
void FastModel::gather(const SurfacePoint& anchor, LobeLight& light, Scratch& s) const {
  const auto count = static_cast<std::size_t>(seen_.size());
  exchange(anchor, seen_, s);
  inner_legs(s);
  s.extent.assign(seen_.spread.begin(), seen_.spread.end());
  s.patches.resize(count);
  const LobeField::View view = lobe_->seen_from(anchor.center, {});
  const LobeRays rays = lobe_rays(anchor.normal, s);
  const LobeSums sums = lobe_sums(s.patches, count);
  for_each_zone([&](int zone, std::size_t begin, std::size_t end) {
    view.gather(rays.from(begin), end - begin, zone, sums.from(begin));
  });
  light.resize(count);
  lobe_moments(s, count, s.patches, light);
  light.known = true;
}

/// Takes away what occluders hide of the lobes of one node: the share of the light and its paths'
/// change, about those patches that shadows come near.
void FastModel::shade_lobes(const SurfacePoint& node, const std::vector<OccluderFace>& occluders,
                            Scratch& s) const {
  s.extent.assign(seen_.spread.begin(), seen_.spread.end());
  for (const auto& [patch, part] : s.partial) s.extent[patch] *= part.fraction * part.fraction;
  const LobeField::View view = lobe_->seen_from(node.center, occluders);
  const LobeRays rays = lobe_rays(node.normal, s);
  s.open.resize(LobeField::kChunk);
  s.shaded.resize(LobeField::kChunk);
  for_each_zone([&](int zone, std::size_t first, std::size_t end) {
    for (std::size_t begin = first; begin < end; begin += LobeField::kChunk) {
      const std::size_t count = std::min(LobeField::kChunk, end - begin);
      const double* weight = s.patches.weight.data() + begin;
      if (std::all_of(weight, weight + count, [](double w) { return w <= 0; })) continue;
      if (!view.gather_shaded(rays.from(begin), count, zone, lobe_sums(s.open, count),
                              lobe_sums(s.shaded, count))) {
        continue;
      }
      for (std::size_t i = 0; i < count; ++i) shade_patch(i, begin + i, s);
    }
  });
}

/// The same for one patch: `i` in the chunk's sums, `patch` of all.
void FastModel::shade_patch(std::size_t i, std::size_t patch, Scratch& s) {
  double& weight = s.patches.weight[patch];
  double& path = s.patches.first[patch];
  double& square = s.patches.second[patch];
  if (weight <= 0) return;
  const double share = s.open.weight[i] > 0 ? s.shaded.weight[i] / s.open.weight[i] : 0.0;
  if (share < kNoShare) {
    weight = path = square = 0;
    return;
  }
  const double open_mean = s.open.first[i] / s.open.weight[i];
  const double mean = s.shaded.first[i] / s.shaded.weight[i];
  const double spread = (s.shaded.second[i] / s.shaded.weight[i] - mean * mean) -
                        (s.open.second[i] / s.open.weight[i] - open_mean * open_mean);
  const double before = path / weight;
  const double after = before + (mean - open_mean);
  const double variance = std::max(square / weight - before * before + spread, 0.0);
  weight *= share;
  path = weight * after;
  square = weight * (after * after + variance);
}

/// Shares of a parallelogram's edges that are left when a straight edge moves its middle by
/// `shift`.
std::array<double, 2> edges_left(const Vector3d& shift, const Vector3d& u, const Vector3d& v) {
  const double uu = u.squaredNorm(), vv = v.squaredNorm(), uv = u.dot(v);
  const double det = uu * vv - uv * uv;
  if (!(det > 0)) return {1, 1};
  const double a = (vv * shift.dot(u) - uv * shift.dot(v)) / det;
  const double b = (uu * shift.dot(v) - uv * shift.dot(u)) / det;
  return {std::max(1 - std::abs(a), 0.0), std::max(1 - std::abs(b), 0.0)};
}

/// Patches as a node sees them.
void FastModel::see_ends(const SurfacePoint& node, const PatchArrays& a, const ShadowView* shadows,
                         const CellNodes& cell, Scratch& s, LobeEnds& ends) const {
  light_between(node, a, shadows, s);
  const auto count = static_cast<std::size_t>(a.size());
  s.left_u.assign(count, 1.0);
  s.left_v.assign(count, 1.0);
  s.from_x.resize(count);
  s.from_y.resize(count);
  s.from_z.resize(count);
  s.distance.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    // A node of a rule stands for its part of the cell, the middle of which is elsewhere.
    s.from_x[i] = a.ax[i] - a.x[i];
    s.from_y[i] = a.ay[i] - a.y[i];
    s.from_z[i] = a.az[i] - a.z[i];
    s.distance[i] = s.path[i] - a.leg[i];
  }
  for (const auto& [patch, part] : s.partial) {
    const auto i = static_cast<int>(patch);
    const auto left = edges_left(part.shift, a.half_u(i), a.half_v(i));
    s.left_u[patch] = left[0];
    s.left_v[patch] = left[1];
    // The outer leg of the part that is seen.
    const Vector3d middle = part.shift + (1 - part.fraction) * (a.area_center(i) - a.center(i));
    s.distance[patch] -= a.leg_direction(i).dot(middle);
    for (auto* v : {&s.from_x, &s.from_y, &s.from_z}) (*v)[patch] *= part.fraction;
  }
  ends.fill({s.weight.data(), s.cosine.data(), s.path.data(),   s.distance.data(), s.dx.data(),
             s.dy.data(),     s.dz.data(),     a.lx.data(),     a.ly.data(),       a.lz.data(),
             a.ux.data(),     a.uy.data(),     a.uz.data(),     a.vx.data(),       a.vy.data(),
             a.vz.data(),     s.left_u.data(), s.left_v.data(), s.from_x.data(),   s.from_y.data(),
             s.from_z.data()},
            a.group_end, a.group_zone, node.normal, cell.half_u, cell.half_v);
}

/// Pairs of a lit and a seen patch.
void FastModel::retro_pairs(const CellNodes& cell, const Shadows& shadows, Scratch& s) const {
  const LobePairs pairs(std::get<RetroreflectiveMaterial>(scene_.hidden.material).lobe_sigma,
                        confocal_);
  for (std::size_t n = 0; n < cell.count; ++n) {
    const SurfacePoint& node = cell.nodes[n];
    const ShadowView* view = shadows.empty() ? nullptr : &shadows[n];
    see_ends(node, lit_, view, cell, s, s.lit_ends);
    see_ends(node, seen_, view, cell, s, s.seen_ends);
    pairs.visit(s.lit_ends, s.seen_ends, scene_.hidden.albedo * node.area, s.pulses,
                [&](int zone, const Pulses& pulses) {
                  s.pair_count += static_cast<double>(pulses.count);
                  add_pulses(s, zone, 0, pulses.count);
                });
  }
}

/// Occluders of this pose where they are not the plan's: all of them outside of the search region,
/// for which the plan was made, and the object itself when that term is switched on.
std::vector<OccluderFace> FastModel::own_occluders(const Placement& placement,
                                                   const Transform& T) const {
  std::vector<OccluderFace> faces;
  if (!overrides_.switched_off(Term::occlusion) && !in_search_region(scene_, placement)) {
    faces = all_occluders_;
  }
  if (overrides_.switched_on(Term::self_shadowing)) {
    if (faces.empty()) faces = plan_.occluders;
    const std::vector<OccluderFace> body = body_faces(scene_.hidden.shape, T, placement.size);
    faces.insert(faces.end(), body.begin(), body.end());
  }
  return faces;
}

/// Object points one by one.
void FastModel::render_points(const Placement& placement, const Transform& T,
                              const std::vector<OccluderFace>& occluders,
                              const MovingBodies& bodies, Scratch& s) const {
  std::vector<OccluderFace> faces;
  for (const SurfacePoint& own : points_) {
    const SurfacePoint point{T * Vector3d(placement.size * own.center), T.linear() * own.normal,
                             placement.size * placement.size * own.area};
    if (!faces_relay(point.center, point.normal)) continue;
    if (occluders.empty() && bodies.empty()) {
      lambertian(point, nullptr, s);
      continue;
    }
    faces = occluders;
    bodies.faces_seen_from(point.center, faces);
    ShadowView shadows(faces, point.center);
    shadows.leave_out_clear_of(relay_.center_of_all, relay_.radius_of_all);
    lambertian(point, shadows.empty() ? nullptr : &shadows, s);
  }
}

/// Object cells one by one, each with its nodes.
void FastModel::render_cells(const Placement& placement, const Transform& T,
                             const std::vector<OccluderFace>& occluders, const MovingBodies& bodies,
                             Scratch& s) const {
  Shadows shadows;
  std::vector<std::vector<OccluderFace>> faces;  // in the way of each node, the same or its own
  const std::vector<SurfaceCell> cells =
      divide(scene_.hidden.shape, T, placement.size, object_edge_, 1);
  std::vector<SurfacePoint> anchors;
  const bool lobes = single_sum() && lobe_;
  if (lobes) {
    anchors = anchors_of(cells);
    if (s.lobes.size() < anchors_) s.lobes.resize(anchors_);
    for (LobeLight& light : s.lobes) light.known = false;
  }
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const SurfaceCell& cell = cells[c];
    if (!faces_relay(cell.center, cell.normal)) continue;
    const std::size_t anchor = lobes ? anchor_[c] : 0;
    if (lobes && !s.lobes[anchor].known) {
      gather(anchors[anchor], s.lobes[anchor], s);
    }
    const CellNodes nodes(cell, object_midpoint_);
    if (!occluders.empty() || !bodies.empty()) {
      shadows.clear();
      faces.clear();
      for (std::size_t n = 0; n < nodes.count; ++n) {
        const Vector3d& point = nodes.nodes[n].center;
        if (bodies.empty()) {
          shadows.emplace_back(occluders, point);
          continue;
        }
        faces.push_back(occluders);
        bodies.faces_seen_from(point, faces.back());
        shadows.emplace_back(faces.back(), point);
      }
    }
    if (plan_.kernel == Kernel::retro_pairs) {
      retro_pairs(nodes, shadows, s);
      continue;
    }
    retro_single(nodes, anchor, shadows,
                 bodies.empty() ? std::span<const std::vector<OccluderFace>>(&occluders, 1)
                                : std::span<const std::vector<OccluderFace>>(faces),
                 s);
  }
}

Scratch& FastModel::own_scratch() {
  thread_local Scratch scratch;
  return scratch;
}

void FastModel::render(const Placement& placement, const MovingBodies& bodies,
                       HistogramCube& out) const {
  const Sensor& sensor = scene_.sensor;
  if (out.rows != sensor.rows || out.columns != sensor.columns || out.bins != sensor.bins) {
    out = HistogramCube(sensor.rows, sensor.columns, sensor.bins);
  } else {
    std::fill(out.values.begin(), out.values.end(), 0.0);
  }
  Scratch& scratch = own_scratch();
  scratch.pair_count = 0;
  const int zones = sensor.zone_count();
  const bool wraps = axis_bins_ != sensor.bins;
  if (wraps) {
    const auto axis = static_cast<std::size_t>(axis_bins_);
    scratch.unfolded.assign(static_cast<std::size_t>(zones) * axis, 0.0);
  }
  scratch.rows = wraps ? scratch.unfolded.data() : out.values.data();
  scratch.prepare(zones, path_cells_);

  const HiddenObject& hidden = scene_.hidden;
  const Transform T = object_to_world(hidden.shape, hidden.anchor, placement);
  const std::vector<OccluderFace> own = own_occluders(placement, T);
  const std::vector<OccluderFace>& occluders = own.empty() ? plan_.occluders : own;
  if (plan_.kernel == Kernel::lambertian) {
    render_points(placement, T, occluders, bodies, scratch);
  } else {
    render_cells(placement, T, occluders, bodies, scratch);
  }
  flush(scratch);
  for (int z = 0; wraps && z < zones; ++z) {
    fold(sensor, z, scratch.rows + static_cast<std::ptrdiff_t>(z) * axis_bins_, axis_bins_,
         out.zone(z));
  }
  mix_zones(sensor, out);
}

/// Several hidden objects, or one that shadows itself: a model for each, with all bodies that are
/// in its way. Light that visits two objects has bounced four times and is left out.
class FastObjects final : public ForwardModel {
 public:
  FastObjects(const Scene& scene, const SensorPlacement& placement, const FastModelOptions& options)
      : scene_(scene) {
    FastModelOptions share = options;  // errors add up in a bin
    share.tolerance /= object_count(scene_);
    for (int i = 0; i < object_count(scene_); ++i) {
      parts_.push_back(std::make_unique<FastModel>(only_object(scene_, i), placement, share));
    }
    plan_ = parts_.front()->plan();
    for (std::size_t i = 1; i < parts_.size(); ++i) {
      join(parts_[i]->plan(), hidden_object(scene_, static_cast<int>(i)).name);
    }
    plan_.decide({Term::self_shadowing, "self-shadowing of the object", true,
                  object_count(scene_) > 1 ? "hidden objects may hide each other"
                                           : "the shape is not convex"});
  }

  using ForwardModel::three_bounce;
  void three_bounce(const PoseVector& pose, HistogramCube& out) const override {
    const std::vector<Placement> placements = placements_at(scene_, pose);
    out = HistogramCube(scene_.sensor.rows, scene_.sensor.columns, scene_.sensor.bins);
    thread_local HistogramCube light;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      MovingBodies bodies;
      for (std::size_t j = 0; j < parts_.size(); ++j) {
        const HiddenObject& other = hidden_object(scene_, static_cast<int>(j));
        if (i != j || !is_convex(other.shape)) bodies.add(other, placements[j]);
      }
      parts_[i]->render(placements[i], bodies, light);
      for (std::size_t k = 0; k < out.values.size(); ++k) out.values[k] += light.values[k];
    }
  }
  const HistogramCube& direct_return() const override { return parts_.front()->direct_return(); }
  const TransportPlan& plan() const override { return plan_; }
  /// The finest of any object: what suits it suits the others.
  std::optional<Fidelity> fidelity() const override {
    Fidelity finest = *parts_.front()->fidelity();
    for (const auto& part : parts_) {
      finest.relay = std::min(finest.relay, part->fidelity()->relay);
      finest.object = std::min(finest.object, part->fidelity()->object);
      finest.lobe_pairs = finest.lobe_pairs || part->fidelity()->lobe_pairs;
    }
    return finest;
  }

 private:
  /// What one object needs, the scene needs. No peak of the sum is below that of one object, so
  /// bounds add.
  void join(const TransportPlan& other, const std::string& name) {
    for (const OccluderFace& face : other.occluders) {
      const bool known = std::ranges::any_of(
          plan_.occluders, [&](const OccluderFace& f) { return f.corners == face.corners; });
      if (!known) plan_.occluders.push_back(face);
    }
    for (const PlanDecision& decision : other.decisions) {
      PlanDecision both = plan_.decision(decision.term);
      if (decision.reason != both.reason) both.reason += "; " + name + ": " + decision.reason;
      both.used = both.used || decision.used;
      both.bound += decision.bound;
      plan_.decide(both);
    }
  }

  Scene scene_;
  std::vector<std::unique_ptr<FastModel>> parts_;
  TransportPlan plan_;
};

}  // namespace

void FastModelOptions::validate() const {
  if (!(tolerance > 0 && tolerance < 1)) {
    throw Error("FastModelOptions.tolerance", "accepted: between 0 and 1");
  }
  if (!(extra_pulse_sigma >= 0)) {
    throw Error("FastModelOptions.extra_pulse_sigma", "accepted: at least 0 s");
  }
  if (fidelity && !(fidelity->relay > 0 && fidelity->object > 0)) {
    throw Error("FastModelOptions.fidelity", "accepted: both above 0");
  }
}

std::unique_ptr<ForwardModel> make_fast_model(const Scene& scene, const SensorPlacement& placement,
                                              const FastModelOptions& options) {
  options.validate();
  if (std::holds_alternative<MeasuredLawMaterial>(scene.hidden.material)) {
    return make_measured_law_model(scene, placement, options.extra_pulse_sigma);
  }
  if (object_count(scene) > 1 || !is_convex(scene.hidden.shape)) {
    return std::make_unique<FastObjects>(scene, placement, options);
  }
  return std::make_unique<FastModel>(scene, placement, options);
}

}  // namespace blindcorner
