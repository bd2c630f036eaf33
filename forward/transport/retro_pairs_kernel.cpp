// SPDX-License-Identifier: Apache-2.0
/// Kernel that sums over pairs of a lit and a seen patch within the lobe's reach (lobe_pairs.h).
#include <algorithm>
#include <array>
#include <cmath>

#include "forward/transport/lobe_pairs.h"
#include "forward/transport/retro_kernel.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Shares of a parallelogram's edges that are left when a straight cut moves its middle by `shift`.
std::array<double, 2> edges_left(const Vector3d& shift, const Vector3d& u, const Vector3d& v) {
  const double uu = u.squaredNorm(), vv = v.squaredNorm(), uv = u.dot(v);
  const double det = uu * vv - uv * uv;
  if (!(det > 0)) return {1, 1};
  const double a = (vv * shift.dot(u) - uv * shift.dot(v)) / det;
  const double b = (uu * shift.dot(v) - uv * shift.dot(u)) / det;
  return {std::max(1 - std::abs(a), 0.0), std::max(1 - std::abs(b), 0.0)};
}

/// Fills `ends` with the patches as a node sees them.
void see_ends(const SurfacePoint& node, const PatchArrays& a, const ShadowView* shadows,
              const CellNodes& cell, Scratch& s, LobeEnds& ends) {
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
    // Takes off the change of the outer leg to the visible part: the inner leg is left.
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

class RetroPairsKernel final : public RetroKernel {
 public:
  explicit RetroPairsKernel(const KernelInputs& inputs)
      : RetroKernel(inputs), pairs_(lobe_sigma(), confocal()) {}

 private:
  void add_cell(const ShadedCell& cell, Scratch& s) const override {
    for (std::size_t n = 0; n < cell.nodes.count; ++n) {
      const SurfacePoint& node = cell.nodes.nodes[n];
      see_ends(node, sampling().lit, cell.shadow(n), cell.nodes, s, s.lit_ends);
      see_ends(node, sampling().seen, cell.shadow(n), cell.nodes, s, s.seen_ends);
      pairs_.visit(s.lit_ends, s.seen_ends, scene().hidden.albedo * node.area, s.pulses,
                   [&](int zone, const Pulses& pulses) {
                     s.pair_count += static_cast<double>(pulses.count);
                     add_pulses(s, zone, 0, pulses.count);
                   });
    }
  }

  /// A pair in reach takes some ten nanoseconds at each of some hundred nodes, and few pairs are in
  /// reach. With kCostly pairs of patches, a node takes up to a millisecond.
  bool costly() const override {
    return static_cast<double>(sampling().lit.size()) * sampling().seen.size() > kCostly;
  }

  static constexpr double kCostly = 1e5;  ///< pairs of patches
  LobePairs pairs_;
};

}  // namespace

std::unique_ptr<TransportKernel> make_retro_pairs_kernel(const KernelInputs& inputs) {
  return std::make_unique<RetroPairsKernel>(inputs);
}

}  // namespace blindcorner
