// SPDX-License-Identifier: Apache-2.0
/// The best fit of a capture, for display.
#pragma once

#include "inverse/search/refine.h"

namespace blindcorner {

/// Histograms of capture `index` of an observation at a fitted pose. `at` is the light at that pose
/// at unit amplitude. Outside the time gates, no light of the object is shown.
FittedHistograms fitted_histograms(const PoseObjective& objective, const Refined& best,
                                   const ShapeBuffer& at, const Capture& capture, int index);

}  // namespace blindcorner
