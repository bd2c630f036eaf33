// SPDX-License-Identifier: Apache-2.0
/// What bins hold that the object does not light: static light, and bins that cannot be used.
#pragma once

#include <vector>

#include "blindcorner/inverse/calibration.h"
#include "calibration_problem.h"

namespace blindcorner {

/// Learns each zone's static background from captures in which the model has no light of the object
/// in the bin (nor in the one beside it), and puts it in the place of what `scene` has. A bin's
/// mean over those captures, less the level of the bins that hold nothing, is taken where it
/// refutes zero by five standard errors, which are those of its scatter from capture to capture.
/// Bins that a modelled direct return lights are not looked at. `keep` is [captures]. Returns what
/// was taken.
std::vector<BackgroundBin> learn_background(
    const CalibrationProblem& problem,
    const std::vector<CalibrationProblem::Evaluation>& evaluations, const std::vector<double>& keep,
    Scene& scene);

/// Finds bins that cannot be used: without any light of the object they vary from capture to
/// capture far more than the others (the foot of a direct return whose strength drifts), or they
/// count less than half of the ambient light that the others have (bins without response). Each
/// zone of `scene` keeps the run of other bins that holds most of the object's light; without an
/// object the longest.
void leave_out_unusable_bins(const CalibrationProblem& problem,
                             const std::vector<CalibrationProblem::Evaluation>& evaluations,
                             const std::vector<double>& keep, Scene& scene);

}  // namespace blindcorner
