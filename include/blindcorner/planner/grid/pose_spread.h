// SPDX-License-Identifier: Apache-2.0
/// Which cells hidden objects occupy, when all that is known of their poses is a mixture.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "blindcorner/forward/scene/pose_mixture.h"
#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/planner/grid/grid_geometry.h"

namespace blindcorner {

/// A cell is occupied where a footprint touches it: where its centre lies in the footprint widened
/// by half a cell (Minkowski sum with the cell's square). Its probability is
///
///     presence * sum over modes of weight * (1 - product over objects of (1 - P_i(cell))),
///
/// P_i the probability under the mode's normal distribution of object i's x, y, yaw and size; an
/// object whose values are not numbers is one that the mode does without.
///
/// Weights that sum to less than one leave the rest to the prior: evenly over the search region.
/// Unknowns that a mode lists as undetermined have their prior too. Positions outside the search
/// region are impossible, except along an axis on which the mode's mean itself has left it, as that
/// of a tracked object may.
///
/// P_i is a sum over yaw and size, each with the positions' mean given them, of footprints drawn on
/// a lattice, and over positions on this lattice: deterministic and smooth in mean and covariance.
/// The lattice's step is about half the smallest standard deviation of the position, and that is
/// taken to be at least a quarter of a cell: nothing finer is resolved. No cell is off by more than
/// 0.02 of what is said of it, as against Monte Carlo over the widened distribution (tests).
class PoseSpread {
 public:
  /// Throws Error when the grid is not valid.
  PoseSpread(const Scene& scene, const GridGeometry& grid);

  /// [cells] probability that a hidden object occupies the cell. `not_seen` [cells], where given,
  /// is the probability that an object which covers the cell's centre would have remained unseen so
  /// far, 0..1. An object has remained unseen with the smallest value of all cells that it covers
  /// (rays that miss it in one cell miss it in the next), which weighs poses, and the probability
  /// of presence, by Bayes' rule. Throws Error as `check`.
  std::vector<double> occupied(const PoseMixture& mixture,
                               std::span<const double> not_seen = {}) const;

  /// Throws Error naming the mode when the mixture's numbers make no distribution.
  void check(const PoseMixture& mixture) const;

  /// The mixture that states the scene's prior: no mode, the prior probability of presence.
  PoseMixture prior() const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

}  // namespace blindcorner
