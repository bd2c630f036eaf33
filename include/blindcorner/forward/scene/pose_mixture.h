// SPDX-License-Identifier: Apache-2.0
/// The answer of the inverse solver for all later stages: a Gaussian mixture over poses, and the
/// probability that an object is present.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "blindcorner/forward/scene/pose.h"

namespace blindcorner {

/// One explanation of the data. Vectors follow the order of the scene's unknowns, SI units.
struct PoseMode {
  double weight = 0.0;            ///< share of the posterior given that an object is present
  PoseVector pose;                ///< mean of the mode
  Eigen::MatrixXd covariance;     ///< [n, n]
  std::vector<int> undetermined;  ///< indices of unknowns that the data leave open
  double log_likelihood = 0.0;    ///< at the mode's optimum, linear unknowns maximised
  PoseVector optimum;  ///< the maximum itself (it differs from the mean of a skewed mode)
};

/// Modes heaviest first; their weights sum to one.
struct PoseMixture {
  std::vector<PoseMode> modes;
  double presence_probability = 0.0;  ///< posterior probability that an object is present
  PoseVector mean;                    ///< of the whole mixture (yaw: circular)
  Eigen::MatrixXd covariance;         ///< of the whole mixture
};

}  // namespace blindcorner
