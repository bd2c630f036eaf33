// SPDX-License-Identifier: Apache-2.0
/// Ambient light and noise of the instrument, from what a fitted model leaves over.
#pragma once

#include <vector>

#include "inverse/calibration/calibration_problem.h"

namespace blindcorner {

/// Sets the prior of each zone's ambient light over the captures: median, and the spread that holds
/// 95 % of them, less what the noise of one estimate makes of it. `flat` was evaluated without that
/// prior. Left alone where a live zone is seen too rarely.
void learn_ambient(const CalibrationProblem& problem, const Evaluations& flat,
                   const std::vector<double>& keep, Scene& scene);

/// Sets the noise from squared residuals, trimmed at three standard deviations: where the noise
/// model states a line, variance = the zone's floor + per_count * mean, zones of few residuals with
/// a floor in common; else the dispersion. Left alone where there are few residuals.
void learn_noise(const CalibrationProblem& problem, const Evaluations& evaluations,
                 const std::vector<double>& keep, Scene& scene);

}  // namespace blindcorner
