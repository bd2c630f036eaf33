// SPDX-License-Identifier: Apache-2.0
/// Ridges of the posterior that leave their peak's Gaussian: components for sampling along them.
#pragma once

#include <vector>

#include "inverse/posterior/importance.h"
#include "inverse/search/climb.h"

namespace blindcorner {

/// Gaussians along the ridges that pass through a peak, without the peak's own. The longest
/// principal axes (in units of the prior's widths) are followed to both sides by a predictor along
/// the ridge and a corrector across it, until the log target has fallen by ten or the prior ends.
/// Before that, a ridge may fall and rise again. A component has the peak's widths across the
/// ridge, the distance to its neighbour as its width along the ridge, and Laplace's evidence with
/// these. There is no component where the target is too low for samples. For a Gaussian posterior
/// of n unknowns this takes some 6 (n + 1) evaluations. `target` is called from several threads.
std::vector<Peak> ridge_components(const Scene& scene, const Peak& peak, const LogTarget& target);

}  // namespace blindcorner
