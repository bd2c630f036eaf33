// SPDX-License-Identifier: Apache-2.0
/// Kernel for a lobe that is small against the lit spot: light comes back from about where it fell.
/// The integral of the lobe over p leaves the radiance about r (lobe_field.h), and light falls with
/// the inverse square of the distance.
#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include "forward/transport/lobe_field.h"
#include "forward/transport/retro_kernel.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// A share of a lobe's light below this counts as none: it is about the error of the normal
/// distribution function (8e-8).
constexpr double kNoShare = 1e-7;

/// Clears the first `count` sums and returns them, so that light can be added.
LobeSums lobe_sums(LightSums& sums, std::size_t count) {
  for (auto* v : {&sums.weight, &sums.first, &sums.second}) std::fill_n(v->begin(), count, 0.0);
  return {sums.weight.data(), sums.first.data(), sums.second.data()};
}

/// Takes away what occluders hide of the light of one patch. The patch has the index `i` in the
/// chunk's sums and `patch` among all patches.
void shade_patch(std::size_t i, std::size_t patch, Scratch& s) {
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

class RetroSingleKernel final : public RetroKernel {
 public:
  explicit RetroSingleKernel(const KernelInputs& inputs) : RetroKernel(inputs) {
    if (!inputs.view.setup.uses_points()) lobe_.emplace(scene(), inputs.view.placement);
  }

 private:
  void begin(const std::vector<SurfaceCell>& cells, Scratch& s) const override {
    if (!lobe_) return;
    s.anchors = middles(cells);
    if (s.lobes.size() < sampling().anchors) s.lobes.resize(sampling().anchors);
    for (LobeLight& light : s.lobes) light.known = false;
  }

  /// Middles of the cells that share an anchor.
  std::vector<SurfacePoint> middles(const std::vector<SurfaceCell>& cells) const {
    std::vector<SurfacePoint> anchors(sampling().anchors,
                                      {Vector3d::Zero(), Vector3d::Zero(), 0.0});
    for (std::size_t c = 0; c < cells.size(); ++c) {
      SurfacePoint& anchor = anchors[sampling().anchor[c]];
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

  void add_cell(const ShadedCell& cell, Scratch& s) const override {
    const PatchArrays& seen = sampling().seen;
    if (lobe_) {
      const std::size_t anchor = sampling().anchor[cell.index];
      if (!s.lobes[anchor].known) gather(s.anchors[anchor], s.lobes[anchor], s);
    }
    // Both outer legs are the patch's own. If paths count from the relay, the legs cancel.
    const double way_in = scene().sensor.path_origin == PathOrigin::sensor ? 1 : 0;
    const std::size_t groups = seen.group_end.size();
    const auto patches = static_cast<std::size_t>(seen.size());
    s.patches.resize(patches);
    s.pulses.resize(groups);
    std::fill_n(s.pulses.weight.begin(), groups, 0.0);
    std::fill_n(s.pulses.path.begin(), groups, 0.0);
    std::fill_n(s.pulses.variance.begin(), groups, 0.0);
    const CellNodes& nodes = cell.nodes;
    for (std::size_t n = 0; n < nodes.count; ++n) {
      const SurfacePoint& node = nodes.nodes[n];
      light_between(node, seen, cell.shadow(n), s);
      const double scale = scene().hidden.albedo * node.area;
      if (lobe_) {
        inner_legs(s);
        lobe_light_of_patches(s, patches, s.lobes[sampling().anchor[cell.index]], scale,
                              nodes.half_u, nodes.half_v, s.patches);
        const auto& faces = cell.occluders[std::min(n, cell.occluders.size() - 1)];
        if (!faces.empty()) shade_lobes(node, faces, s);
      } else {
        retro_light_of_patches(s, seen, scale, nodes.half_u, nodes.half_v, lobe_sigma(), way_in,
                               s.patches);
      }
      std::size_t i = 0;
      for (std::size_t g = 0; g < groups; ++g) {
        for (const auto end = static_cast<std::size_t>(seen.group_end[g]); i < end; ++i) {
          s.pulses.weight[g] += s.patches.weight[i];
          s.pulses.path[g] += s.patches.first[i];
          s.pulses.variance[g] += s.patches.second[i];
        }
      }
    }
    add_seen_pulses(s);
  }

  /// Adds the pulses, given as sums, to the zones of the seen groups: one pulse for each group.
  void add_seen_pulses(Scratch& s) const {
    const std::size_t groups = sampling().seen.group_zone.size();
    normalise(s.pulses, groups);
    for (std::size_t begin = 0; begin < groups;) {
      std::size_t end = begin;
      while (end < groups && sampling().seen.group_zone[end] == sampling().seen.group_zone[begin])
        ++end;
      add_pulses(s, sampling().seen.group_zone[begin], begin, end);
      begin = end;
    }
  }

  LobeRays lobe_rays(const Vector3d& normal, const Scratch& s) const {
    return {s.dx.data(),
            s.dy.data(),
            s.dz.data(),
            s.distance.data(),
            s.path.data(),
            s.extent.data(),
            sampling().seen.lx.data(),
            sampling().seen.ly.data(),
            sampling().seen.lz.data(),
            sampling().seen.ux.data(),
            sampling().seen.uy.data(),
            sampling().seen.uz.data(),
            sampling().seen.vx.data(),
            sampling().seen.vy.data(),
            sampling().seen.vz.data(),
            normal};
  }

  /// Visits the patches whose lobes may be handled together: zone, first and one past the last.
  void for_each_zone(const std::function<void(int, std::size_t, std::size_t)>& visit) const {
    for (std::size_t g = 0, begin = 0; g < sampling().seen.group_end.size();) {
      const int zone = sampling().seen.group_zone[g];
      while (g < sampling().seen.group_end.size() &&
             (!confocal() || sampling().seen.group_zone[g] == zone))
        ++g;
      const auto end = static_cast<std::size_t>(sampling().seen.group_end[g - 1]);
      visit(zone, begin, end);
      begin = end;
    }
  }

  /// Finds the inner legs of the ways out in `s`.
  void inner_legs(Scratch& s) const {
    s.distance.resize(static_cast<std::size_t>(sampling().seen.size()));
    for (std::size_t i = 0; i < s.distance.size(); ++i)
      s.distance[i] = s.path[i] - sampling().seen.leg[i];
  }

  /// Finds the light that the lobes about all patches gather, without occluders.
  void gather(const SurfacePoint& anchor, LobeLight& light, Scratch& s) const {
    const auto count = static_cast<std::size_t>(sampling().seen.size());
    exchange(anchor, sampling().seen, s);
    inner_legs(s);
    s.extent.assign(sampling().seen.spread.begin(), sampling().seen.spread.end());
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

  /// Takes away what occluders hide of the lobes of one node. Corrects the light and its paths for
  /// those patches that shadows come near.
  void shade_lobes(const SurfacePoint& node, const std::vector<OccluderFace>& occluders,
                   Scratch& s) const {
    s.extent.assign(sampling().seen.spread.begin(), sampling().seen.spread.end());
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

  std::optional<LobeField> lobe_;  ///< empty for relay points
};

}  // namespace

std::unique_ptr<TransportKernel> make_retro_single_kernel(const KernelInputs& inputs) {
  return std::make_unique<RetroSingleKernel>(inputs);
}

}  // namespace blindcorner
