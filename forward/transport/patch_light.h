// SPDX-License-Identifier: Apache-2.0
/// Light between a point of the object and all patches of the relay. The fast model's kernels work
/// on it.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "blindcorner/forward/scene/shape.h"
#include "forward/relay/relay_setup.h"
#include "forward/relay/visibility.h"
#include "forward/transport/lobe_pairs.h"
#include "forward/transport/path_grid.h"

namespace blindcorner {

/// Structure of arrays, so that the loop over patches vectorises.
struct PatchArrays {
  std::vector<double> x, y, z, ax, ay, az, nx, ny, nz, ux, uy, uz, vx, vy, vz, lx, ly, lz;
  std::vector<double> weight, leg, albedo, radiance;
  std::vector<double> spread;   ///< variance of the path over a patch per squared half-edge change
  std::vector<int> group_end;   ///< one past the last patch of each group
  std::vector<int> group_zone;  ///< zone that sees (or lights) the group
  std::vector<int> set_end;     ///< one past the last patch of each set appended

  /// Consecutive patches, and a ball around their areas: one look at the ball may settle their
  /// shadows.
  struct Block {
    int begin, end;
    Eigen::Vector3d center;
    double radius;
  };
  std::vector<Block> blocks;
  Eigen::Vector3d center_of_all = Eigen::Vector3d::Zero();  ///< of a ball around all patches
  double radius_of_all = 0;

  static constexpr int kBlock = ShadowView::kChunk;

  int size() const { return static_cast<int>(x.size()); }
  /// Coordinates of the areas that the patches stand for.
  PatchCoordinates coordinates() const {
    return {{ax.data(), ay.data(), az.data()},
            {ux.data(), uy.data(), uz.data()},
            {vx.data(), vy.data(), vz.data()}};
  }
  /// Appends the patches of a zone, or of none (-1), as a set. Consecutive patches with the same
  /// group number are a group.
  void append(const std::vector<WeightedPatch>& patches, int zone);
  /// To be called after the last patch: makes the blocks, and pads the coordinates to whole blocks.
  void finish();
  std::pair<std::size_t, std::size_t> set(std::size_t i) const {
    return {i == 0 ? 0 : static_cast<std::size_t>(set_end[i - 1]),
            static_cast<std::size_t>(set_end[i])};
  }
  Eigen::Vector3d center(int i) const { return at(x, y, z, i); }
  Eigen::Vector3d area_center(int i) const { return at(ax, ay, az, i); }
  Eigen::Vector3d normal(int i) const { return at(nx, ny, nz, i); }
  Eigen::Vector3d half_u(int i) const { return at(ux, uy, uz, i); }
  Eigen::Vector3d half_v(int i) const { return at(vx, vy, vz, i); }
  Eigen::Vector3d leg_direction(int i) const { return at(lx, ly, lz, i); }

 private:
  void add(const WeightedPatch& p) {
    const RelayPatch& patch = p.patch;
    const auto put = [](const Eigen::Vector3d& v, std::vector<double>& a, std::vector<double>& b,
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
    albedo.push_back(patch.albedo);
    radiance.push_back(p.radiance);
  }
  static Eigen::Vector3d at(const std::vector<double>& a, const std::vector<double>& b,
                            const std::vector<double>& c, int i) {
    const auto k = static_cast<std::size_t>(i);
    return {a[k], b[k], c[k]};
  }
};

/// Light of each patch by itself, as sums.
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

/// Light that the lobe about every seen patch gathers, as seen from one place on the object.
struct LobeLight {
  std::vector<double> radiance;  ///< mean over the lobe, W/m^2/sr
  std::vector<double> shift;     ///< m, mean path less the way out and less its inner leg
  std::vector<double> variance;  ///< m^2, of the path over lobe and patch
  bool known = false;

  void resize(std::size_t count) {
    for (auto* v : {&radiance, &shift, &variance}) v->resize(count);
  }
};

/// Patch that a point sees in part, and that part. Its shift counts from the centre of the patch's
/// area.
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
  std::vector<SurfacePoint> anchors;     ///< middles of the cells that share an anchor
  LightSums open, shaded;                ///< of some patches, for shadows in lobes
  std::vector<Sums> cells;               ///< [zone][path cell]; all zero between evaluations
  std::vector<Range> touched;            ///< [zone] path cells that hold light
  LightSums patches;                     ///< of one node, each patch by itself
  PathLight arriving, leaving;           ///< of one object point
  PathGrid::Splines splines;
  std::vector<PathLight> pairs;  ///< [zone]; dark between evaluations
  Pulses pulses;
  std::vector<double> left_u, left_v;          ///< shares of patches' edges that are seen
  std::vector<double> from_x, from_y, from_z;  ///< m, from patches' points to their middles
  LobeEnds lit_ends, seen_ends;
  double pair_count = 0;  ///< pairs of a lit and a seen patch that were looked at

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

/// Nodes of a cell: two along either edge.
constexpr int kNodes = 4;

/// A cell as 2 x 2 Gauss-Legendre nodes, or as its centre with a path variance from its edges.
struct CellNodes {
  std::array<SurfacePoint, kNodes> nodes;
  std::size_t count = kNodes;
  Eigen::Vector3d half_u =
      Eigen::Vector3d::Zero();  ///< zero when the nodes' own spread stands for the cell's
  Eigen::Vector3d half_v = Eigen::Vector3d::Zero();

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
void exchange_paths(const SurfacePoint& cell, const PatchArrays& a, Scratch& s);

/// Exchange between an object point and every patch: weights with both cosines and 1/r^2, paths,
/// path variances over the patch, unit directions from the cell.
void exchange(const SurfacePoint& cell, const PatchArrays& a, Scratch& s);

/// Weights, paths and directions between a node and all patches, less what shadows (may be null)
/// hide of them.
void light_between(const SurfacePoint& node, const PatchArrays& arrays, const ShadowView* shadows,
                   Scratch& s);

/// Takes the shadowed parts of patches away from weights and paths, and from directions where
/// exchange() has found them.
void shade_patches(const SurfacePoint& node, const PatchArrays& arrays, const ShadowView* shadows,
                   Scratch& s);

/// From sums to mean path and variance.
void normalise(Pulses& p, std::size_t count);

/// Light that comes back to the relay points that it fell on, of each point by itself: sums of
/// weight, path and path squared. `way_in` is one when both outer legs count, and zero when they
/// cancel.
void retro_light_of_patches(const Scratch& s, const PatchArrays& a, double scale,
                            const Eigen::Vector3d& u, const Eigen::Vector3d& v, double lobe_sigma,
                            double way_in, LightSums& out);

/// From sums to mean radiance, shift of the path and its variance.
void lobe_moments(const Scratch& s, std::size_t n, const LightSums& sums, LobeLight& light);

/// Light that a node sends back to every patch, of each patch by itself: sums of weight, path and
/// path squared. Both legs change along the half edges u and v of the node's cell.
void lobe_light_of_patches(const Scratch& s, std::size_t n, const LobeLight& light, double scale,
                           const Eigen::Vector3d& u, const Eigen::Vector3d& v, LightSums& sums);

/// Path cells before path zero and after the end of the time axis, for pulses that only just reach
/// the axis. The widest pulse is six times as wide as the sensor's (widest_blur), and a cell is 0.4
/// standard deviations of the sensor's pulse (kPathCell). Four standard deviations of the widest
/// pulse are then 60 cells.
constexpr int kCellMargin = 64;

/// Adds pulses to the two nearest of `count` path cells, each in proportion to nearness. Moments
/// are about the cell's own path, against cancellation. Widens `touched` by the cells used.
void add_to_cells(const Pulses& p, std::size_t begin, std::size_t end, double cells_per_metre,
                  int count, Sums* cells, Range& touched);

}  // namespace blindcorner
