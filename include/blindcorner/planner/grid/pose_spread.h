// SPDX-License-Identifier: Apache-2.0
/// Which cells hidden objects occupy when their poses are known only as a mixture.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "blindcorner/forward/scene/pose_mixture.h"
#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/planner/grid/grid_geometry.h"

namespace blindcorner {

/// A cell is occupied if a footprint touches it: if its centre lies in the footprint widened by
/// half a cell (Minkowski sum with the cell's square). Its probability is
///
///     presence * sum over modes of weight * (1 - product over objects of (1 - P_i(cell))),
///
/// where P_i is the probability under the mode's normal distribution of object i's x, y, yaw and
/// size. An object whose values are not numbers is absent from the mode.
///
/// If the weights sum to less than one, the prior takes the rest: evenly over the search region.
/// Unknowns that a mode lists as undetermined also have their prior. Positions outside the search
/// region are impossible, except along an axis on which the mode's mean itself has left the region,
/// as the mean of a tracked object may.
///
/// P_i is a sum over yaw and size and over positions on a lattice. For each yaw and size, the
/// positions have the mean given them, and the footprint is drawn on the same lattice. The result
/// is deterministic and smooth in mean and covariance. The lattice's step is about half the
/// smallest standard deviation of the position. That standard deviation is taken to be at least a
/// quarter of a cell: nothing finer is resolved. No cell differs by more than 0.02 from a Monte
/// Carlo estimate over the widened distribution (tests).
class PoseSpread {
 public:
  /// Throws Error when the grid is not valid.
  PoseSpread(const Scene& scene, const GridGeometry& grid);

  /// [cells] probability that a hidden object occupies the cell. `not_seen` ([cells] or empty) is
  /// the probability, 0..1, that an object which covers the cell's centre would have remained
  /// unseen so far. An object has remained unseen with the smallest value among all cells that it
  /// covers: rays that miss it in one cell also miss it in the next. By Bayes' rule this weighs
  /// poses and the probability of presence. Throws Error as `check` does.
  std::vector<double> occupied(const PoseMixture& mixture,
                               std::span<const double> not_seen = {}) const;

  /// Throws Error naming the mode when the mixture's numbers are not a valid distribution.
  void check(const PoseMixture& mixture) const;

  /// The mixture that states the scene's prior: no modes, and the prior probability of presence.
  PoseMixture prior() const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

}  // namespace blindcorner
