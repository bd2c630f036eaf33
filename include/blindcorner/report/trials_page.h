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

/// Place of the page of one trial's drive, relative to the study's directory.
std::filesystem::path replay_page(const Trial& trial);

/// Content of the page in addition to the trials' own figures.
struct TrialsExtras {
  /// Drives that are played side by side (replay_pair).
  nlohmann::json pairs = nlohmann::json::array();
  /// Limits on paper, from limits.json; null: none.
  nlohmann::json limits = nullptr;
};

/// A self-contained page: success by speed zone with intervals beside the published bars,
/// differences paired by seed, success against injected error, clearance and time, reliability of
/// the map, failed trials. `results` are in their files' order; `replayed` tells which trials have
/// a page. Published bars appear for drives whose zones they fit.
std::string trials_page(const Drive& drive, const std::vector<TrialResult>& results,
                        const std::function<bool(const Trial&)>& replayed,
                        const TrialsExtras& extras = {});

}  // namespace blindcorner
