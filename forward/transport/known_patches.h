// SPDX-License-Identifier: Apache-2.0
/// Patches of the known surfaces that send each other light, and trees whose parts stand for many
/// patches that are far away.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "blindcorner/forward/scene/shape.h"
#include "forward/relay/relay_setup.h"
#include "forward/relay/visibility.h"

namespace blindcorner {

/// A patch as a cell of its surface.
SurfaceCell cell_of(const RelayPatch& patch);

/// Patches side by side in memory, padded to whole chunks of ShadowView.
struct KnownPatches {
  // Centre, normal, half edges, gradient of the outer leg.
  std::array<std::vector<double>, 3> c, n, u, v, g;
  std::vector<double> weight, leg;
  std::vector<double> extent;  ///< sum of the squared half edges, m^2
  std::vector<SurfaceCell> cells;
  std::vector<int> zone;

  std::size_t size() const { return weight.size(); }
  void clear();
  void add(const SurfaceCell& cell, const Eigen::Vector3d& gradient, double weight_of_it,
           double leg_of_it, int zone_of_it);
  /// Adds the patch lifted off its surface, so that the surface does not hide its own patches.
  void add(const WeightedPatch& patch, int zone_of_it);
  void pad();
  Eigen::Vector3d gradient(std::size_t i) const { return {g[0][i], g[1][i], g[2][i]}; }
  PatchCoordinates coordinates() const;
};

/// Legs from one point to patches.
struct KnownLegs {
  std::vector<double> weight, length, x, y, z;  ///< direction from the point
  std::vector<double> du, dv;                   ///< half extents of the path over the patch
  std::vector<ShadowView::Sight> sights;

  /// Finds the legs from a cell to patches. Weights include both cosines and the share that
  /// `shadows` leave visible.
  void find(const SurfaceCell& cell, const ShadowView& shadows, const KnownPatches& patches);
};

/// Ball of cells for which a tree has to be fine enough.
struct Ball {
  Eigen::Vector3d center;
  double radius = 0;
  /// Of the plane that all cells lie on; zero: they lie on several.
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
};

/// Patches of one zone and plane, halved again and again. Each part has the light of its patches
/// and the first two moments of the light's place. Far away, few parts are enough: a sum over all
/// pairs of n patches becomes one over n log n (Hanrahan, Salzman and Aupperle 1991, "A rapid
/// hierarchical radiosity algorithm").
class PatchTree {
 public:
  /// `angle`: largest edge of a part relative to its distance from the cells that exchange light
  /// with it. `sensor_angle`: the same for the distance from the sensor. A single patch is fine
  /// enough at any distance.
  PatchTree(const KnownPatches& patches, double angle, double sensor_angle);

  /// The coarsest parts for light to or from a ball. Left out are those on planes that have nothing
  /// of the ball in front of them, and those behind the ball's own plane.
  void cut(const Ball& ball, KnownPatches& parts) const;

  /// Groups of patches that lie close together, at most `most` patches in each.
  std::vector<std::vector<std::size_t>> blocks(std::size_t most) const;

 private:
  struct Node {
    SurfaceCell cell;
    Eigen::Vector3d gradient;
    double weight = 0, leg = 0;
    double edge = 0;  // m; infinite where the sensor is too near for it
    int zone = 0;
    std::size_t begin = 0, end = 0;  // of order_
    std::size_t parts = 0;           // index of the first of two; 0: a patch
  };
  static bool behind(const Ball& ball, const Node& part);
  void build(const KnownPatches& patches, std::size_t begin, std::size_t end, std::size_t at);
  Node sum_of(const KnownPatches& patches, std::size_t begin, std::size_t end) const;

  double angle_, sensor_angle_;
  std::vector<std::size_t> order_;  // of the patches: those of a node follow each other
  std::vector<Node> nodes_;
  std::vector<std::size_t> roots_;
};

/// The ball around the centres of cells.
Ball ball_around(std::span<const SurfaceCell* const> cells);

}  // namespace blindcorner
