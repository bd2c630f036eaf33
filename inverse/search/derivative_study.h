// SPDX-License-Identifier: Apache-2.0
/// Errors of a forward model's numeric derivatives, by step.
#pragma once

#include <vector>

#include "blindcorner/forward/transport/forward_model.h"

namespace blindcorner {

struct DerivativeErrors {
  std::vector<double> steps;   ///< in the unknown's unit
  std::vector<double> errors;  ///< relative L2 error of the central difference at each step
  double at_default = 0;       ///< the same at the default step
  /// Disagreement of the extrapolation with itself: errors below this are not resolved.
  double resolution = 0;
};

/// Compares central differences of the whole histogram along one unknown with Ridders'
/// extrapolation (Adv. Eng. Software 4, 1982). Its steps go from four default steps down by factors
/// of 1.5. It is Richardson's extrapolation, stopped where it agrees best with itself, because
/// kinks of the model end its convergence.
DerivativeErrors derivative_errors(const ForwardModel& model, const PoseVector& pose,
                                   Eigen::Index unknown, const std::vector<double>& steps,
                                   double default_step);

}  // namespace blindcorner
