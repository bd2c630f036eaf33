// SPDX-License-Identifier: Apache-2.0
/// Scale of the noise, from the errors of fits to captures of known poses.
#pragma once

#include <vector>

#include "inverse/calibration/calibration_problem.h"

namespace blindcorner {

/// Multiplies the variance of all counts, and of the ambient light's prior.
void scale_variance(Scene& scene, double factor);

/// Factor on the variance, at least 1, at which fits to the problem's own captures, with their
/// poses taken as unknown, have a mean squared normalised error of one.
double find_variance_scale(const Scene& scene, const CalibrationProblem& problem,
                           const std::vector<double>& keep);

}  // namespace blindcorner
