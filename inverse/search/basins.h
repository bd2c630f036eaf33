// SPDX-License-Identifier: Apache-2.0
/// From scored poses to optima: where descents start, in which basins they end, and where else a
/// better optimum may be.
#pragma once

#include <span>
#include <vector>

#include "blindcorner/inverse/fit.h"
#include "inverse/search/refine.h"
#include "inverse/search/scoring.h"

namespace blindcorner {

/// Scores every pose on the grid. `near`, unless null, is the part of the search region near the
/// relay. The starts that score() finds there are added to the starts, with their log posteriors in
/// the whole region.
Scored score_all(const PoseObjective& whole, const LinearSolution& without,
                 const CompiledScene* near, std::span<const Capture> captures,
                 const FitOptions& options);

/// Chooses where descents start: at the best of the poses that closed form has chosen and the
/// models have evaluated. Without closed form, descents start from all of `scored.starts`.
std::vector<Start> choose_starts(const PoseObjective& objective, const Scored& scored);

/// `optima`, and the optima of the basins in which approach() ended, best first.
std::vector<Refined> with_basins(const PoseObjective& objective, std::vector<Refined> basins,
                                 double negligible, std::vector<Refined> optima);

/// Searches for a better optimum where few descents end by themselves: at other yaws of the best
/// one and, with several objects, at other places of one object while the others stay. Repeats this
/// until there is no better one, for at most kMaxRounds rounds.
std::vector<Refined> look_elsewhere(const PoseObjective& objective, const FitOptions& options,
                                    double negligible, std::vector<Refined> optima);

}  // namespace blindcorner
