// SPDX-License-Identifier: Apache-2.0
/// What bins hold that the object does not light: static light, and bins that cannot be used.
#pragma once

#include <vector>

#include "blindcorner/inverse/calibration/calibration.h"
#include "inverse/calibration/calibration_problem.h"

namespace blindcorner {

/// Light of the object below this share of its zone's peak is none to speak of: by judgement, one
/// photon where the brightest bin has a thousand.
inline constexpr double kDarkShare = 1e-3;

/// What is known when static light is looked for.
enum class Knowledge {
  stated,  ///< the stated scene: any spot may belong to any zone, so a bin has to be dark in all
  fitted   ///< a model that has been fitted
};

/// Learns each zone's static background from captures in which neither the bin nor a neighbour
/// holds more than a thousandth of the light that the object sends to the zone. A bin's mean over
/// those captures, less object, modelled direct return and ambient light, is taken where it is
/// five standard errors from zero; these are those of its scatter from capture to capture, but not
/// less than the noise model's in the proportion that is usual in the zone. Bins of which too
/// little is seen (eight captures; without an object one, where photons are counted), or that a
/// modelled direct return lights, keep what `stated` has. `keep` is [captures]. Changes the zones
/// of `scene`; returns what was taken.
std::vector<BackgroundBin> learn_background(
    const CalibrationProblem& problem,
    const std::vector<CalibrationProblem::Evaluation>& evaluations, const std::vector<double>& keep,
    const Sensor& stated, Knowledge knowledge, Scene& scene);

/// Finds bins that cannot be used: without light of the object they vary from capture to capture
/// far more than the others (the foot of a direct return whose strength drifts), or they count less
/// than half of the ambient light that the others have (bins without response). Each zone of
/// `scene` keeps the run of other bins that holds most of the object's light; without an object the
/// longest.
void leave_out_unusable_bins(const CalibrationProblem& problem,
                             const std::vector<CalibrationProblem::Evaluation>& evaluations,
                             const std::vector<double>& keep, Scene& scene);

}  // namespace blindcorner
