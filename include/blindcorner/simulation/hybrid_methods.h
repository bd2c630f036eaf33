// SPDX-License-Identifier: Apache-2.0
/// Solver and network together, to measure whether the network's answer is worth its start.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "blindcorner/inverse/baseline/cnn.h"
#include "blindcorner/simulation/comparison.h"

namespace blindcorner {

/// Two methods. The first descends from the network's answer alone, nothing is searched; its region
/// is Laplace's about the optimum found. The second is `fit` with the network's answer as one more
/// start: where the descent from it ends in an optimum of more evidence than that of the heaviest
/// mode, that is the answer.
std::vector<ComparedMethod> hybrid_methods(const Scene& scene, const CnnBaseline& cnn,
                                           const std::string& network, std::uint64_t seed);

}  // namespace blindcorner
