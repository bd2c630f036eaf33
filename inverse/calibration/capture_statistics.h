// SPDX-License-Identifier: Apache-2.0
/// What captures say apart from the parameters: which of them count, and how bright they are.
#pragma once

#include <vector>

#include "inverse/calibration/calibration_problem.h"

namespace blindcorner {

/// Whether a zone of the capture holds data. A zone without data is observed with next to no
/// exposure, and its variance is out of all proportion. Variances are compared at `level` expected
/// counts.
bool has_data(const Observation& observation, const ObservedZone& zone, double level);

/// Number of a capture's bins in zones that hold data, at least one.
double degrees_of_freedom(const Observation& observation);

/// Sum of the deviances of the captures that are kept.
double total_deviance(const Evaluations& evaluations, const std::vector<double>& keep);

/// Huber's weights of whole captures: a capture counts in full while its deviance is within half of
/// `sigmas` of what is usual, and then less and less.
std::vector<double> huber_weights(const CalibrationProblem& problem, const Evaluations& evaluations,
                                  const std::vector<double>& keep, double sigmas);

/// Whether each capture, [captures], fits: 0 where the deviance is more than `sigmas` above what is
/// usual, else 1.
std::vector<double> fitting_captures(const CalibrationProblem& problem,
                                     const Evaluations& evaluations, double sigmas);

/// Natural logarithm of the brightness that the captures have in common: the median over those that
/// determine it.
double typical_log_amplitude(const Evaluations& evaluations);

/// Spread of log amplitudes beyond their own errors.
double brightness_spread(const Evaluations& free, const std::vector<double>& keep);

}  // namespace blindcorner
