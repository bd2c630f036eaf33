// SPDX-License-Identifier: Apache-2.0
/// What a calibration tells besides the scene: the bins and captures used, the values, and
/// histograms for display.
#pragma once

#include <string>
#include <vector>

#include "inverse/calibration/calibration_problem.h"

namespace blindcorner {

/// Says which valid bins are not as stated, and in which zones; empty: all are.
std::string valid_bins_note(const std::vector<Zone>& stated, const Sensor& sensor);

/// The parameters in the units of their names. `covariance` is that of u, [n, n].
std::vector<CalibratedParameter> estimates(const CalibrationProblem& problem,
                                           const Eigen::VectorXd& u,
                                           const Eigen::MatrixXd& covariance);

/// Tells which captures were used, and why the others were not. `sensor` is the stated one.
void tell_captures(const Sensor& sensor, const CalibrationProblem& problem,
                   const Evaluations& evaluations, const std::vector<double>& keep,
                   Calibration& result);

/// Mean histograms over captures, less the static background. Each capture is shifted so that the
/// object's light arrives in the same bin.
std::vector<CalibrationView> views(const CalibrationProblem& problem, const Evaluations& before,
                                   const Evaluations& after, const std::vector<double>& keep);

}  // namespace blindcorner
