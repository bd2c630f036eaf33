// SPDX-License-Identifier: Apache-2.0
/// The page of a study of trials.
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "blindcorner/simulation/trials.h"

namespace blindcorner {

/// Where the page of one trial's drive lies, relative to the study's directory.
std::filesystem::path replay_page(const Trial& trial);

/// A self-contained page: success by speed zone with intervals beside the published bars,
/// differences paired by seed, success against injected error, clearance and time, reliability of
/// the map, failed trials. `results` in their files' order; `replayed` says which trials have a
/// page, `pairs` (replay_pair) are the drives that are played side by side. Published bars stand
/// beside drives whose zones they fit.
std::string trials_page(const Drive& drive, const std::vector<TrialResult>& results,
                        const std::function<bool(const Trial&)>& replayed,
                        const nlohmann::json& pairs = nlohmann::json::array());

}  // namespace blindcorner
