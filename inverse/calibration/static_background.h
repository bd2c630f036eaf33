// SPDX-License-Identifier: Apache-2.0
/// Static light, found in bins that the object does not light, and bins that cannot be used.
#pragma once

#include <vector>

#include "blindcorner/inverse/calibration/calibration.h"
#include "inverse/calibration/calibration_problem.h"

namespace blindcorner {

/// The object's light counts as none below this share of its peak in the zone. By judgement: one
/// photon where the brightest bin has a thousand.
inline constexpr double kDarkShare = 1e-3;

/// What is known when static light is looked for.
enum class Knowledge {
  stated,  ///< the stated scene: any spot may belong to any zone, so a bin has to be dark in all
  fitted   ///< a model that has been fitted
};

/// Learns each zone's static background. A bin is learned from the captures in which neither it nor
/// a neighbour holds more than a thousandth of the object's peak light in the zone. The bin's mean
/// over those captures, less object, modelled direct return and ambient light, is taken if it is
/// more than five standard errors from zero. The standard error follows from the bin's scatter from
/// capture to capture, but it is at least that of the noise model times the ratio that is usual in
/// the zone. Bins keep what `stated` has if they are seen too rarely (in fewer than eight captures;
/// one is enough where photons are counted and there is no object) or if a modelled direct return
/// lights them. `keep` is [captures]. Changes the zones of `scene`; returns what was taken.
std::vector<BackgroundBin> learn_background(
    const CalibrationProblem& problem,
    const std::vector<CalibrationProblem::Evaluation>& evaluations, const std::vector<double>& keep,
    const Sensor& stated, Knowledge knowledge, Scene& scene);

/// Finds bins that cannot be used. Either they vary from capture to capture, without light of the
/// object, far more than the others (the foot of a direct return whose strength drifts), or they
/// count less than half of the ambient light that the others have (bins without response). Each
/// zone of `scene` keeps the run of other bins that holds most of the object's light or, without an
/// object, the longest run.
void leave_out_unusable_bins(const CalibrationProblem& problem,
                             const std::vector<CalibrationProblem::Evaluation>& evaluations,
                             const std::vector<double>& keep, Scene& scene);

}  // namespace blindcorner
