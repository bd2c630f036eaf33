// SPDX-License-Identifier: Apache-2.0
/// The part of a page of trials on collisions against speed: what a perception avoids, and what
/// that costs.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "blindcorner/simulation/trials.h"

namespace blindcorner {

/// Collisions against the wanted speed with the limits on paper, the front of collisions against
/// mean speed with risks varied, a table of costs and their differences paired by seed. `limits` as
/// limits.json has them (docs/drive.md); null: none. Results without injected errors.
std::string front_section(const Drive& drive, const std::vector<TrialResult>& results,
                          const nlohmann::json& limits);

}  // namespace blindcorner
