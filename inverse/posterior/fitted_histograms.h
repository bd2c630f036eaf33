// SPDX-License-Identifier: Apache-2.0
/// The best fit of a capture, for looking at.
#pragma once

#include "inverse/search/refine.h"

namespace blindcorner {

/// Histograms of capture `index` of an observation at a fitted pose, whose light at unit amplitude
/// is `at`; outside of the time gates no object's light is shown.
FittedHistograms fitted_histograms(const PoseObjective& objective, const Refined& best,
                                   const ShapeBuffer& at, const Capture& capture, int index);

}  // namespace blindcorner
