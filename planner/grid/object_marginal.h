// SPDX-License-Identifier: Apache-2.0
/// What a mode of a mixture says about one hidden object's place on the ground.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <span>
#include <vector>

#include "blindcorner/forward/scene/footprint.h"
#include "blindcorner/forward/scene/pose_mixture.h"
#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/planner/grid/grid_geometry.h"

namespace blindcorner {

/// A hidden object seen from above, and where its unknowns stand in the scene's list.
struct GroundObject {
  GroundObject(const Scene& scene, int object);

  Footprint outline;      ///< for Placement{}, counter-clockwise, m
  Placement known;        ///< what the scene states
  double radius = 0;      ///< m, farthest corner of the outline from the anchor
  double yaw_period = 0;  ///< rad; 0: yaw changes nothing
  /// Indices of x, y, yaw and size in the scene's unknowns; -1: known, or without effect.
  int x = -1, y = -1, yaw = -1, size = -1;
  std::vector<int> unknowns;  ///< indices of all unknowns of the object, z included
};

/// Values that one shape unknown (yaw, size) may have: normal, cut off at both ends.
struct ShapeRange {
  double mean = 0;
  double sigma = 0;
  double lower = 0, upper = 0;  ///< within 4 sigma, the period and the prior's range
};

/// Normal distribution of the position given the shape, and that of the shape itself.
struct ObjectMarginal {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();         ///< m, at the mean shape
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();       ///< m^2, given yaw and size
  Eigen::Matrix2d slope = Eigen::Matrix2d::Zero();            ///< of x, y (rows) on yaw, size
  Eigen::Matrix2d shape_precision = Eigen::Matrix2d::Zero();  ///< of yaw and size
  ShapeRange yaw, size;
  /// Limits of the search region, m; infinite along an axis that has none.
  Eigen::Vector2d lower = Eigen::Vector2d::Constant(-std::numeric_limits<double>::infinity());
  Eigen::Vector2d upper = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
};

/// The moments that an unknown has before anything is measured.
NormalPrior moments_of(const Unknown& unknown);

/// A mode that knows no more than the prior.
PoseMode prior_mode(const std::vector<Unknown>& unknowns, double weight);

/// The modes of a mixture, and a mode of the prior with the weight that they leave.
std::vector<PoseMode> with_prior(const PoseMixture& mixture, const std::vector<Unknown>& unknowns);

/// Whether a mode says that the object is not there: none of its unknowns has a value.
bool is_absent(const PoseMode& mode, const GroundObject& object);

/// Throws Error unless `not_seen` is empty or has one value for each cell.
void check_not_seen(std::span<const double> not_seen, const GridGeometry& grid);

/// Marginal of one object under a mode. For unknowns that the mode lists as undetermined, the
/// mode's covariance contains the prior as a normal distribution of the prior's moments. That part
/// is taken out here (precisions subtract), because the limits put in the prior itself, which is
/// flat. What the data say of such an unknown together with others (a ridge) is kept in this way.
ObjectMarginal marginal_of(const PoseMode& mode, const std::vector<Unknown>& unknowns,
                           const GroundObject& object);

}  // namespace blindcorner
