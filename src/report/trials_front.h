// SPDX-License-Identifier: Apache-2.0
/// The part of a page of trials on collisions against speed: what a perception avoids, and what
/// that costs.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "blindcorner/simulation/trials.h"

namespace blindcorner {

/// Charts of the collisions against the wanted speed, with the limits on paper, and of the front of
/// collisions against mean speed, with risks varied; a table of costs, and one of their differences
/// paired by seed. `results` have no injected errors. `limits` is the content of limits.json
/// (docs/drive.md); null: there is none.
std::string front_section(const Drive& drive, const std::vector<TrialResult>& results,
                          const nlohmann::json& limits);

}  // namespace blindcorner
