// SPDX-License-Identifier: Apache-2.0
/// Ambient light and noise of the instrument, from the residuals of a fitted model.
#pragma once

#include <vector>

#include "inverse/calibration/calibration_problem.h"

namespace blindcorner {

/// Sets the prior of each zone's ambient light: its mean is the median over the captures. Its
/// standard deviation follows from the distance to the median that holds 95 % of them, less the
/// noise of one estimate. `flat` was evaluated without that prior. Nothing is set if any live zone
/// is seen too rarely.
void learn_ambient(const CalibrationProblem& problem, const Evaluations& flat,
                   const std::vector<double>& keep, Scene& scene);

/// Sets the noise from squared residuals, trimmed at three standard deviations. If the noise model
/// states a line, variance = the zone's floor + per_count * mean, and zones with few residuals
/// share a floor; otherwise the dispersion is set. Nothing is set if there are few residuals.
void learn_noise(const CalibrationProblem& problem, const Evaluations& evaluations,
                 const std::vector<double>& keep, Scene& scene);

}  // namespace blindcorner
