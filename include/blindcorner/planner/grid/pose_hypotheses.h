// SPDX-License-Identifier: Apache-2.0
/// Poses that hidden objects may have, one by one.
///
/// A cell's probability says nothing of its neighbour's: cells that one object covers are occupied
/// together. The probability that any of many cells is occupied, of all that a vehicle will sweep,
/// is therefore a sum over poses and never a product over cells.
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
  double probability = 0;            ///< that it is there and has this pose
  std::vector<std::size_t> covers;   ///< cells whose centre lies in it: rays through them end
  std::vector<std::size_t> touches;  ///< cells that it reaches into, these included
};

class PoseHypotheses {
 public:
  /// Throws Error when the grid is not valid.
  PoseHypotheses(const Scene& scene, const GridGeometry& grid);

  /// Hypotheses of all objects. For each their probabilities sum to that of its presence; those of
  /// several objects are taken by themselves, so that a sum over all is at most too large. Poses
  /// follow the mixture as PoseSpread describes it (what weights leave open is the prior's), and
  /// `not_seen` [cells] or empty weighs them by Bayes' rule as there: by its smallest value among
  /// the cells that a pose covers. Poses are an additive recurrence's points (Roberts 2018,
  /// generalised golden ratio), the same at every call: some 2000 for each object, so that a share
  /// of a thousandth is resolved. Throws Error for a mixture that is none, as PoseSpread does.
  std::vector<PoseHypothesis> of(const PoseMixture& mixture,
                                 std::span<const double> not_seen = {}) const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

}  // namespace blindcorner
