// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/lobe_pairs.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "forward/support/multiversion.h"
#include "forward/transport/normal_density.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Number of patches that are handled together: one or two vectors of doubles, and so few that many
/// blocks can be skipped.
constexpr std::size_t kBlock = 8;
/// Squared distance in standard deviations at which a lobe ends. The lobe is lowered by its value
/// there, so that it ends without a step. The rest is scaled to hold all of the light.
constexpr double kReach2 = 16;
constexpr double kFloor = 3.35463e-4;  // exp(-kReach2 / 2), rounded up
constexpr double kScale = 1 / (1 - (1 + kReach2 / 2) * kFloor);

/// Patches as arrays; a single patch on the seen side.
struct Ends {
  const double *weight, *path, *variance, *x, *y, *factor, *ee, *ff, *ef;
  const double *xxxx, *xxxy, *xxyy, *xyyy, *yyyy;
  const double *ke, *kf, *gu, *gv;
};

/// Pulses of one seen patch with the lit patches of some blocks: kBlock pulses for each block.
BLINDCORNER_MULTIVERSION void pair_up(const Ends& lit, const std::vector<PatchRange>& blocks,
                                      const Ends& seen, double lobe_variance, double scale,
                                      double* __restrict weight, double* __restrict path,
                                      double* __restrict variance) {
  const double light = *seen.weight * scale * kScale / (2 * kPi);
  const double seen_path = *seen.path, seen_variance = *seen.variance;
  const double seen_x = *seen.x, seen_y = *seen.y, seen_factor = *seen.factor;
  const double seen_ee = *seen.ee, seen_ff = *seen.ff, seen_ef = *seen.ef;
  const double seen_ke = *seen.ke, seen_kf = *seen.kf;
  const double seen_gu = *seen.gu, seen_gv = *seen.gv;
  const double seen_xxxx = *seen.xxxx, seen_xxxy = *seen.xxxy, seen_xxyy = *seen.xxyy;
  const double seen_xyyy = *seen.xyyy, seen_yyyy = *seen.yyyy;
  for (const PatchRange block : blocks) {
    BLINDCORNER_INDEPENDENT
    for (std::size_t k = 0; k < kBlock; ++k) {
      const std::size_t i = block.begin + k;
      const double area = seen_factor * lit.factor[i];  // of the map over solid angle
      const double own = lobe_variance * area;
      const double ee = own + seen_ee + lit.ee[i];
      const double ff = own + seen_ff + lit.ff[i];
      const double ef = seen_ef + lit.ef[i];
      const double x = lit.x[i] - seen_x;
      const double y = lit.y[i] - seen_y;
      const double inverse = 1 / (ee * ff - ef * ef);
      const double square = (ff * x * x - 2 * ef * x * y + ee * y * y) * inverse;
      const double lobe = std::max(gaussian_of_square(std::min(square, kReach2)) - kFloor, 0.0);
      const double gu = seen_gu + lit.gu[i];
      const double gv = seen_gv + lit.gv[i];
      // Edgeworth's correction: fourth cumulants times fourth derivatives of the normal
      // distribution. With a = C^-1 X and Q = C^-1, the derivatives are the density times a^4 - 6 Q
      // a^2 + 3 Q^2 (symmetrised).
      const double xx = ff * inverse, yy = ee * inverse, xy = -ef * inverse;
      const double ax = xx * x + xy * y, ay = xy * x + yy * y;
      const double axx = ax * ax, axy = ax * ay, ayy = ay * ay;
      const double fourth =
          (seen_xxxx + lit.xxxx[i]) * (axx * axx + 3 * xx * (xx - 2 * axx)) +
          (seen_yyyy + lit.yyyy[i]) * (ayy * ayy + 3 * yy * (yy - 2 * ayy)) +
          4 * (seen_xxxy + lit.xxxy[i]) * (axx * axy + 3 * (xx * (xy - axy) - xy * axx)) +
          4 * (seen_xyyy + lit.xyyy[i]) * (ayy * axy + 3 * (yy * (xy - axy) - xy * ayy)) +
          6 * (seen_xxyy + lit.xxyy[i]) *
              (axy * axy - xx * ayy - yy * axx + xx * yy + 2 * xy * (xy - 2 * axy));
      const double shape = std::max(1 + fourth / 24, 0.0);
      const double light_of_pair = light * lit.weight[i] * area * lobe * shape * std::sqrt(inverse);
      weight[k] = k < block.count ? light_of_pair : 0.0;
      // Covariance of the path with x and y. The lobe brings x and y to zero, which takes `shift`
      // from the path and `known` from its variance.
      const double ke = lit.ke[i] - seen_ke;
      const double kf = lit.kf[i] - seen_kf;
      const double shift = (ke * (ff * x - ef * y) + kf * (ee * y - ef * x)) * inverse;
      const double known = (ff * ke * ke - 2 * ef * ke * kf + ee * kf * kf) * inverse;
      path[k] = seen_path + lit.path[i] - shift;
      variance[k] =
          std::max(seen_variance + lit.variance[i] - known, 0.0) + (gu * gu + gv * gv) / 3;
    }
    weight += kBlock;
    path += kBlock;
    variance += kBlock;
  }
}

}  // namespace

void LobeEnds::Mapped::resize(std::size_t count) {
  for (auto* v : {&x, &y, &path, &ux, &uy, &vx, &vy, &along_u, &along_v, &weight}) {
    if (v->size() < count) v->resize(count);
  }
}

BLINDCORNER_MULTIVERSION void LobeEnds::map(const LobePieces& p, std::size_t count,
                                            const Vector3d& normal, const Vector3d& e,
                                            const Vector3d& f) {
  mapped_.resize(count);
  const double nx = normal.x(), ny = normal.y(), nz = normal.z();
  const double ex = e.x(), ey = e.y(), ez = e.z(), fx = f.x(), fy = f.y(), fz = f.z();
  double* __restrict ox = mapped_.x.data();
  double* __restrict oy = mapped_.y.data();
  double* __restrict path = mapped_.path.data();
  double* __restrict oux = mapped_.ux.data();
  double* __restrict ouy = mapped_.uy.data();
  double* __restrict ovx = mapped_.vx.data();
  double* __restrict ovy = mapped_.vy.data();
  double* __restrict along_u = mapped_.along_u.data();
  double* __restrict along_v = mapped_.along_v.data();
  double* __restrict weight = mapped_.weight.data();
  const LobePieces a = p;
  BLINDCORNER_INDEPENDENT
  for (std::size_t i = 0; i < count; ++i) {
    const double dx = a.dx[i], dy = a.dy[i], dz = a.dz[i];
    const double c = dx * nx + dy * ny + dz * nz;
    const double factor = 1 / (1 + std::max(c, 0.0));
    const double de = dx * ex + dy * ey + dz * ez, df = dx * fx + dy * fy + dz * fz;
    const double x = factor * de, y = factor * df;
    const double gx = dx + a.lx[i], gy = dy + a.ly[i], gz = dz + a.lz[i];
    const double turn = factor / a.distance[i];
    // A step s from the piece turns the direction by (s - (s . d) d) / r.
    const auto place = [&](double sx, double sy, double sz, double& to_x, double& to_y) {
      const double away = sx * dx + sy * dy + sz * dz;
      const double rise = sx * nx + sy * ny + sz * nz - away * c;
      to_x = turn * (sx * ex + sy * ey + sz * ez - away * de - rise * x);
      to_y = turn * (sx * fx + sy * fy + sz * fz - away * df - rise * y);
    };
    const double ux = a.left_u[i] * a.ux[i], uy = a.left_u[i] * a.uy[i], uz = a.left_u[i] * a.uz[i];
    const double vx = a.left_v[i] * a.vx[i], vy = a.left_v[i] * a.vy[i], vz = a.left_v[i] * a.vz[i];
    const double bx = a.bx[i], by = a.by[i], bz = a.bz[i];
    double middle_x, middle_y, mux, muy, mvx, mvy;
    place(bx, by, bz, middle_x, middle_y);
    place(ux, uy, uz, mux, muy);
    place(vx, vy, vz, mvx, mvy);
    ox[i] = x + middle_x;
    oy[i] = y + middle_y;
    path[i] = a.path[i] + gx * bx + gy * by + gz * bz;
    oux[i] = mux;
    ouy[i] = muy;
    ovx[i] = mvx;
    ovy[i] = mvy;
    along_u[i] = gx * ux + gy * uy + gz * uz;
    along_v[i] = gx * vx + gy * vy + gz * vz;
    // The lobe is divided by the root of both cosines, so that each side keeps the root of its own.
    weight[i] = a.weight[i] > 0 ? a.weight[i] / std::sqrt(std::max(a.cosine[i], 1e-12)) : 0.0;
  }
}

/// Fourth cumulants of the light's place on the map, over the pieces [begin, end) of a patch whose
/// weight, mean and covariance are known. The light of a piece is even along both of its edges.
void LobeEnds::find_fourth(std::size_t begin, std::size_t end, std::size_t to) {
  const Mapped& m = mapped_;
  double xxxx = 0, xxxy = 0, xxyy = 0, xyyy = 0, yyyy = 0;
  for (std::size_t i = begin; i < end; ++i) {
    const double w = m.weight[i] / weight_[to];
    const double dx = m.x[i] - x_[to], dy = m.y[i] - y_[to];
    const double ux = m.ux[i], uy = m.uy[i], vx = m.vx[i], vy = m.vy[i];
    const double dxx = dx * dx, dxy = dx * dy, dyy = dy * dy;
    const double uxx = ux * ux, uxy = ux * uy, uyy = uy * uy;
    const double vxx = vx * vx, vxy = vx * vy, vyy = vy * vy;
    const double sxx = (uxx + vxx) / 3, sxy = (uxy + vxy) / 3, syy = (uyy + vyy) / 3;
    // Moments of d + s u + t v: s^2 and t^2 have the mean 1/3, s^4 and t^4 the mean 1/5.
    xxxx += w * (dxx * dxx + 6 * dxx * sxx + (uxx * uxx + vxx * vxx) / 5 + 2 * uxx * vxx / 3);
    xxxy += w * (dxx * dxy + 3 * (dxx * sxy + dxy * sxx) + (uxx * uxy + vxx * vxy) / 5 +
                 (uxx * vxy + uxy * vxx) / 3);
    xxyy += w * (dxx * dyy + dxx * syy + dyy * sxx + 4 * dxy * sxy + (uxx * uyy + vxx * vyy) / 5 +
                 (uxx * vyy + uyy * vxx + 4 * uxy * vxy) / 9);
    xyyy += w * (dyy * dxy + 3 * (dyy * sxy + dxy * syy) + (uyy * uxy + vyy * vxy) / 5 +
                 (uyy * vxy + uxy * vyy) / 3);
    yyyy += w * (dyy * dyy + 6 * dyy * syy + (uyy * uyy + vyy * vyy) / 5 + 2 * uyy * vyy / 3);
  }
  const double ee = ee_[to], ff = ff_[to], ef = ef_[to];
  xxxx_[to] = xxxx - 3 * ee * ee;
  xxxy_[to] = xxxy - 3 * ee * ef;
  xxyy_[to] = xxyy - ee * ff - 2 * ef * ef;
  xyyy_[to] = xyyy - 3 * ff * ef;
  yyyy_[to] = yyyy - 3 * ff * ff;
}

/// Makes patch `to` from the pieces [begin, end). Returns whether they have light.
bool LobeEnds::add(std::size_t begin, std::size_t end, std::size_t to) {
  const Mapped& m = mapped_;
  double weight = 0, x = 0, y = 0, path = 0, xx = 0, yy = 0, xy = 0, xp = 0, yp = 0, pp = 0;
  for (std::size_t i = begin; i < end; ++i) {
    const double w = m.weight[i];
    // Sums are about the first piece, against cancellation.
    const double dx = m.x[i] - m.x[begin], dy = m.y[i] - m.y[begin], dp = m.path[i] - m.path[begin];
    const double ux = m.ux[i], uy = m.uy[i], vx = m.vx[i], vy = m.vy[i];
    const double pu = m.along_u[i], pv = m.along_v[i];
    weight += w;
    x += w * dx;
    y += w * dy;
    path += w * dp;
    xx += w * (dx * dx + (ux * ux + vx * vx) / 3);
    yy += w * (dy * dy + (uy * uy + vy * vy) / 3);
    xy += w * (dx * dy + (ux * uy + vx * vy) / 3);
    xp += w * (dx * dp + (ux * pu + vx * pv) / 3);
    yp += w * (dy * dp + (uy * pu + vy * pv) / 3);
    pp += w * (dp * dp + (pu * pu + pv * pv) / 3);
  }
  if (!(weight > 0)) return false;
  const double inverse = 1 / weight;
  x *= inverse;
  y *= inverse;
  path *= inverse;
  weight_[to] = weight;
  path_[to] = m.path[begin] + path;
  variance_[to] = std::max(pp * inverse - path * path, 0.0);
  x_[to] = m.x[begin] + x;
  y_[to] = m.y[begin] + y;
  factor_[to] = 0.5 * (1 + x_[to] * x_[to] + y_[to] * y_[to]);
  ee_[to] = xx * inverse - x * x;
  ff_[to] = yy * inverse - y * y;
  ef_[to] = xy * inverse - x * y;
  ke_[to] = xp * inverse - x * path;
  kf_[to] = yp * inverse - y * path;
  find_fourth(begin, end, to);
  return true;
}

void LobeEnds::fill(const LobePieces& pieces, const std::vector<int>& group_end,
                    const std::vector<int>& group_zone, const Vector3d& normal,
                    const Vector3d& half_u, const Vector3d& half_v) {
  const std::size_t groups = group_end.size();
  for (auto* v : {&weight_, &path_, &variance_, &x_, &y_, &factor_, &ee_, &ff_, &ef_, &xxxx_,
                  &xxxy_, &xxyy_, &xyyy_, &yyyy_, &ke_, &kf_, &gu_, &gv_}) {
    if (v->size() < groups + kBlock) v->resize(groups + kBlock);  // whole blocks are read
  }
  if (zone_.size() < groups) zone_.resize(groups);
  const Vector3d e = normal.unitOrthogonal();
  const Vector3d f = normal.cross(e);
  map(pieces, groups > 0 ? static_cast<std::size_t>(group_end.back()) : 0, normal, e, f);
  size_ = 0;
  for (std::size_t g = 0, begin = 0; g < groups; ++g) {
    const auto end = static_cast<std::size_t>(group_end[g]);
    if (add(begin, end, size_)) {
      // Directions d = (2 X, 1 - X^2) / (1 + X^2) in (e, f, normal).
      const double x = x_[size_], y = y_[size_];
      const Vector3d d =
          (2 * x * e + 2 * y * f + (1 - x * x - y * y) * normal) / (1 + x * x + y * y);
      gu_[size_] = d.dot(half_u);
      gv_[size_] = d.dot(half_v);
      zone_[size_] = group_zone[g];
      ++size_;
    }
    begin = end;
  }
  blocks_.clear();
  for (std::size_t begin = 0; begin < size_; begin += blocks_.patches.back().count) {
    blocks_.add(*this, begin);
  }
}

void LobeEnds::Blocks::clear() {
  patches.clear();
  zone.clear();
  for (auto* v : {&left, &right, &low, &high, &factor, &ee, &ff}) v->clear();
}

/// Adds a block of the patches from `begin` on.
void LobeEnds::Blocks::add(const LobeEnds& ends, std::size_t begin) {
  std::size_t end = begin;
  while (end < ends.size_ && end - begin < kBlock && ends.zone_[end] == ends.zone_[begin]) ++end;
  const auto range = [&](const std::vector<double>& values) {
    const auto at = [&](std::size_t i) { return values.begin() + static_cast<std::ptrdiff_t>(i); };
    return std::minmax_element(at(begin), at(end));
  };
  patches.push_back({begin, end - begin});
  zone.push_back(ends.zone_[begin]);
  const auto [most_left, most_right] = range(ends.x_);
  left.push_back(*most_left);
  right.push_back(*most_right);
  const auto [lowest, highest] = range(ends.y_);
  low.push_back(*lowest);
  high.push_back(*highest);
  factor.push_back(*range(ends.factor_).second);
  ee.push_back(*range(ends.ee_).second);
  ff.push_back(*range(ends.ff_).second);
}

std::array<std::size_t, 2> LobeEnds::Blocks::of_zone(int z) const {
  const auto first = std::ranges::find(zone, z);
  const auto end = std::find_if(first, zone.end(), [&](int other) { return other != z; });
  return {static_cast<std::size_t>(first - zone.begin()),
          static_cast<std::size_t>(end - zone.begin())};
}

/// Finds the blocks that may come within the lobe's reach. No point of an ellipse is farther from
/// its middle along an axis than the reach times the standard deviation along that axis.
BLINDCORNER_MULTIVERSION void LobePairs::find_reached(const LobeEnds& lit, const LobeEnds& seen,
                                                      std::size_t i, Reach& reach) const {
  const auto [first, end] = reach.blocks;
  const LobeEnds::Blocks& all = lit.blocks_;
  reach.within.resize(all.size());
  const double px = seen.x_[i], py = seen.y_[i], ee = seen.ee_[i], ff = seen.ff_[i];
  const double own = variance_ * seen.factor_[i];
  const double *left = all.left.data(), *right = all.right.data();
  const double *low = all.low.data(), *high = all.high.data();
  const double *factor = all.factor.data(), *lit_ee = all.ee.data(), *lit_ff = all.ff.data();
  double* __restrict within = reach.within.data();
  BLINDCORNER_INDEPENDENT
  for (std::size_t b = first; b < end; ++b) {
    const double x = std::max(std::max(left[b] - px, px - right[b]), 0.0);
    const double y = std::max(std::max(low[b] - py, py - high[b]), 0.0);
    const double lobe = own * factor[b];
    within[b] = std::min(kReach2 * (lobe + ee + lit_ee[b]) - x * x,
                         kReach2 * (lobe + ff + lit_ff[b]) - y * y);
  }
  reach.reached.clear();
  for (std::size_t b = first; b < end; ++b) {
    if (within[b] > 0) reach.reached.push_back(all.patches[b]);
  }
}

void LobePairs::pair(const LobeEnds& lit, const std::vector<PatchRange>& blocks,
                     const LobeEnds& seen, std::size_t i, double scale, Pulses& pulses) const {
  const auto from = [](const LobeEnds& e, std::size_t k) {
    return Ends{&e.weight_[k], &e.path_[k], &e.variance_[k], &e.x_[k],    &e.y_[k],
                &e.factor_[k], &e.ee_[k],   &e.ff_[k],       &e.ef_[k],   &e.xxxx_[k],
                &e.xxxy_[k],   &e.xxyy_[k], &e.xyyy_[k],     &e.yyyy_[k], &e.ke_[k],
                &e.kf_[k],     &e.gu_[k],   &e.gv_[k]};
  };
  pulses.count = blocks.size() * kBlock;
  pulses.resize(pulses.count);
  pair_up(from(lit, 0), blocks, from(seen, i), variance_, scale, pulses.weight.data(),
          pulses.path.data(), pulses.variance.data());
}

}  // namespace blindcorner
