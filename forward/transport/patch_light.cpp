// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/patch_light.h"

#include <algorithm>
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "forward/support/multiversion.h"

namespace blindcorner {

using Eigen::Vector3d;

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

namespace {

/// Takes the shadowed part of one patch away.
void shade(const SurfacePoint& node, const PatchArrays& arrays, const ShadowView& shadows,
           int patch, Scratch& s) {
  const auto k = static_cast<std::size_t>(patch);
  // What lies behind the object's surface is dark. The visible part of a patch may lie in front of
  // the surface even if the patch's own point lies behind it.
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

}  // namespace

/// Takes the shadowed parts of patches away from weights and paths, and from directions where
/// exchange() has found them.
void shade_patches(const SurfacePoint& node, const PatchArrays& arrays, const ShadowView* shadows,
                   Scratch& s) {
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

/// Weights, paths and directions between a node and all patches, shadows included.
void light_between(const SurfacePoint& node, const PatchArrays& arrays, const ShadowView* shadows,
                   Scratch& s) {
  exchange(node, arrays, s);
  shade_patches(node, arrays, shadows, s);
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

/// Light that comes back to the relay points that it fell on, of each point by itself: sums of
/// weight, path and path squared. `way_in` is one when both outer legs count, and zero when they
/// cancel.
BLINDCORNER_MULTIVERSION void retro_light_of_patches(const Scratch& s, const PatchArrays& a,
                                                     double scale, const Vector3d& u,
                                                     const Vector3d& v, double lobe_sigma,
                                                     double way_in, LightSums& out) {
  const double ux = u.x(), uy = u.y(), uz = u.z(), vx = v.x(), vy = v.y(), vz = v.z();
  const double *w = s.weight.data(), *l = s.path.data(), *var = s.variance.data();
  const double *dx = s.dx.data(), *dy = s.dy.data(), *dz = s.dz.data();
  const double *nx = a.nx.data(), *ny = a.ny.data(), *nz = a.nz.data();
  const double *lx = a.lx.data(), *ly = a.ly.data(), *lz = a.lz.data();
  const double *leg = a.leg.data(), *albedo = a.albedo.data();
  double* __restrict o0 = out.weight.data();
  double* __restrict o1 = out.first.data();
  double* __restrict o2 = out.second.data();
  const double lobe2 = lobe_sigma * lobe_sigma;
  const int n = a.size();
  BLINDCORNER_INDEPENDENT
  for (int i = 0; i < n; ++i) {
    const double weight = scale * w[i] * (albedo[i] / kPi);
    const double r = l[i] - leg[i];
    // The lobe scatters p about the relay point by sigma r, stretched along the tilt by 1/cos. By
    // judgement 20 times at most, because the footprint's light falls with the cosine.
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

/// Light that a node sends back to every patch, of each patch by itself: sums of weight, path and
/// path squared. Both legs change along the half edges u and v of the node's cell.
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

/// Adds pulses to the two nearest of `count` path cells, each in proportion to nearness. Moments
/// are about the cell's own path, against cancellation. Widens `touched` by the cells used.
BLINDCORNER_MULTIVERSION void add_to_cells(const Pulses& p, std::size_t begin, std::size_t end,
                                           double cells_per_metre, int count, Sums* cells,
                                           Range& touched) {
  constexpr std::size_t kChunk = 64;  // by judgement: vectors of each array stay in the cache
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

}  // namespace blindcorner
