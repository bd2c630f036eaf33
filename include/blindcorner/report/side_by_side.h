// SPDX-License-Identifier: Apache-2.0
/// Two drives through the same world, played side by side with one clock.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "blindcorner/simulation/trials.h"

namespace blindcorner {

/// Two replays (drive_replay) of one seed as an entry of the lists below. `pages`: where all about
/// each drive is, relative to the page; empty: nowhere. Throws Error unless the seeds are the same.
nlohmann::json replay_pair(nlohmann::json first, nlohmann::json second,
                           const std::pair<std::string, std::string>& pages = {});

/// What a plain page holds to play a list of pairs, with a choice where there are several; it shows
/// the first, at the moment that tells both drives apart, and waits.
std::string side_by_side_part(const nlohmann::json& pairs);

/// A self-contained page of its own, which begins to play.
std::string side_by_side_page(const std::string& title, const nlohmann::json& pairs);

/// The two perceptions of a study whose comparison says most: direct sight, and what sees around
/// the corner. Empty: there is none.
std::optional<std::pair<std::string, std::string>> telling_perceptions(
    const std::vector<TrialResult>& results);

/// Seeds to play both drives of, at most `most`. First the one where the first perception collides
/// and the second reaches its goal; then one of each other kind, so that what speaks against the
/// second is there too: the first stands or the second is the one that fails, both collide, both
/// arrive with the greatest difference in time. Then more of these, in the same order.
std::vector<std::uint64_t> telling_seeds(const std::vector<TrialResult>& results,
                                         const std::pair<std::string, std::string>& perceptions,
                                         int most);

}  // namespace blindcorner
