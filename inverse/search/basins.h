// SPDX-License-Identifier: Apache-2.0
/// From scored poses to optima: where descents start, the basins that they end in, and where else a
/// better one may be.
#pragma once

#include <span>
#include <vector>

#include "blindcorner/inverse/fit.h"
#include "inverse/search/refine.h"
#include "inverse/search/scoring.h"

namespace blindcorner {

/// Every pose on the grid, with the log posterior in the whole search region. Those of the part
/// near the relay come on top, where `near` is one.
Scored score_all(const PoseObjective& whole, const LinearSolution& without,
                 const CompiledScene* near, std::span<const Capture> captures,
                 const FitOptions& options);

/// Where descents start: closed form chooses the poses that the models look at, and these the
/// starts.
std::vector<Start> choose_starts(const PoseObjective& objective, const Scored& scored);

/// Optima of the basins that approach() ended in, and `optima`, best first.
std::vector<Refined> with_basins(const PoseObjective& objective, std::vector<Refined> basins,
                                 double negligible, std::vector<Refined> optima);

/// Looks for a better optimum than the best one where few descents end by themselves, until there
/// is none: turned, and, of several objects, at another place of one while the others stay.
std::vector<Refined> look_elsewhere(const PoseObjective& objective, const FitOptions& options,
                                    double negligible, std::vector<Refined> optima);

}  // namespace blindcorner
