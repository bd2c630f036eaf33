// SPDX-License-Identifier: Apache-2.0
/// Ridges of the posterior that leave their peak's Gaussian: components for sampling along them.
#pragma once

#include <vector>

#include "inverse/posterior/importance.h"
#include "inverse/search/climb.h"

namespace blindcorner {

/// Gaussians along the ridges that pass through a peak, apart from the peak's own: the principal
/// axes that are nearly as long as the longest (in units of the prior's widths) are followed to
/// both sides by a predictor along the ridge and a corrector across it, until the log target has
/// fallen by ten, or the prior ends; a ridge may fall and rise again before. A component has the
/// peak's widths across the ridge and the distance to its neighbour along it, and Laplace's
/// evidence with these; where nothing is to be drawn there is none. Of a Gaussian posterior of n
/// unknowns it takes some 6 (n + 1) evaluations. The target is asked from several threads.
std::vector<Peak> ridge_components(const Scene& scene, const Peak& peak, const LogTarget& target);

}  // namespace blindcorner
