// SPDX-License-Identifier: Apache-2.0
/// Noise as large as the errors of fits to captures of known poses say.
#pragma once

#include <vector>

#include "inverse/calibration/calibration_problem.h"

namespace blindcorner {

/// Multiplies the variance of all counts, and of the ambient light's prior.
void scale_variance(Scene& scene, double factor);

/// Factor on the variance, at least 1, that brings the mean squared normalised error of fits to the
/// problem's own captures, their poses taken as unknown, to one.
double find_variance_scale(const Scene& scene, const CalibrationProblem& problem,
                           const std::vector<double>& keep);

}  // namespace blindcorner
