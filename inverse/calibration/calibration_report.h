// SPDX-License-Identifier: Apache-2.0
/// What a calibration tells besides the scene: which bins and captures, which values, how it looks.
#pragma once

#include <string>
#include <vector>

#include "inverse/calibration/calibration_problem.h"

namespace blindcorner {

/// Valid bins that are not as stated, and of which zones; empty: all are.
std::string valid_bins_note(const std::vector<Zone>& stated, const Sensor& sensor);

/// The parameters in the units of their names; `covariance` of u, [n, n].
std::vector<CalibratedParameter> estimates(const CalibrationProblem& problem,
                                           const Eigen::VectorXd& u,
                                           const Eigen::MatrixXd& covariance);

/// Which captures were used, and why the others were not. `sensor`: as stated.
void tell_captures(const Sensor& sensor, const CalibrationProblem& problem,
                   const Evaluations& evaluations, const std::vector<double>& keep,
                   Calibration& result);

/// Mean histograms over captures without the static background, each shifted so that the object's
/// light arrives together.
std::vector<CalibrationView> views(const CalibrationProblem& problem, const Evaluations& before,
                                   const Evaluations& after, const std::vector<double>& keep);

}  // namespace blindcorner
