// SPDX-License-Identifier: Apache-2.0
/// Possible poses of hidden objects, one by one.
///
/// A cell's probability says nothing about its neighbour's: cells that one object covers are
/// occupied together. Therefore the probability that any cell is occupied, among all cells that a
/// vehicle will sweep, is a sum over poses and never a product over cells.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "blindcorner/forward/scene/pose_mixture.h"
#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/planner/grid/grid_geometry.h"

namespace blindcorner {

/// One object at one pose.
struct PoseHypothesis {
  double probability = 0;            ///< that the object is there and has this pose
  std::vector<std::size_t> covers;   ///< cells whose centre it covers: rays through them end
  std::vector<std::size_t> touches;  ///< cells that the object reaches into, including `covers`
};

class PoseHypotheses {
 public:
  /// Throws Error when the grid is not valid.
  PoseHypotheses(const Scene& scene, const GridGeometry& grid);

  /// Hypotheses of all objects. For each object their probabilities sum to its probability of
  /// presence. Several objects are treated separately, so that a sum over all of them can only be
  /// too large. Poses follow the mixture as PoseSpread describes it (the prior takes what the
  /// weights leave open). `not_seen` ([cells] or empty) weighs the poses by Bayes' rule as in
  /// PoseSpread: by its smallest value among the cells that a pose covers. The poses are points of
  /// an additive recurrence (Roberts 2018, generalised golden ratio), the same at every call. There
  /// are some 2000 for each object, so that a share of a thousandth is resolved. Throws Error for
  /// an invalid mixture, as PoseSpread does.
  std::vector<PoseHypothesis> of(const PoseMixture& mixture,
                                 std::span<const double> not_seen = {}) const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

}  // namespace blindcorner
