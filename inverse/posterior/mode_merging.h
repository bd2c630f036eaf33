// SPDX-License-Identifier: Apache-2.0
/// When two optima are one mode of the posterior. In the order in which the fit asks:
///  1. merge(): they lie within a quarter of the grid's spacing, so that descents from two starts
///     ended at the same place;
///  2. within_better(): one lies inside the width of a better one;
///  3. connect(): no valley parts them.
#pragma once

#include <vector>

#include "inverse/posterior/importance.h"
#include "inverse/search/refine.h"

namespace blindcorner {

/// Whether descents that ended at two poses ended at the same place.
bool same_place(const CompiledScene& compiled, const PoseVector& a, const PoseVector& b);

/// Merges refined starts that ended at the same optimum, best first; drops those `negligible` or
/// more in log posterior below the best.
std::vector<Refined> merge(const CompiledScene& compiled, std::vector<Refined> optima,
                           double negligible);

/// Whether a pose lies within one standard deviation (Mahalanobis) of one of the peaks.
bool within_better(const Scene& scene, const std::vector<Peak>& better, const PoseVector& pose);

/// Groups optima (best first) with no valley between them: on the straight way from one to the
/// other the log posterior falls less than one below the lower end. Returns for each the index of
/// its group's best.
std::vector<std::size_t> connect(const PoseObjective& objective,
                                 const std::vector<const Refined*>& optima, double inflation);

}  // namespace blindcorner
