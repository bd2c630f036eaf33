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

/// Two replays (drive_replay) of one seed as an entry of the lists below. `pages`: the place of
/// each drive's own page, relative to this page; empty: no page. Throws Error unless the seeds are
/// the same.
nlohmann::json replay_pair(nlohmann::json first, nlohmann::json second,
                           const std::pair<std::string, std::string>& pages = {});

/// The part of a plain page that plays a list of pairs, with a choice if there are several. It
/// shows the first pair at the moment that tells both drives apart, and waits.
std::string side_by_side_part(const nlohmann::json& pairs);

/// A self-contained page that starts to play at once. `pairs` must not be empty.
std::string side_by_side_page(const std::string& title, const nlohmann::json& pairs);

/// The two perceptions of a study whose comparison tells most: direct sight, and one that sees
/// around the corner. Empty: the study has fewer than two perceptions.
std::optional<std::pair<std::string, std::string>> telling_perceptions(
    const std::vector<TrialResult>& results);

/// Seeds whose two drives are worth playing, at most `most`. First comes a seed where the first
/// perception collides and the second reaches its goal. Then comes one seed of each other kind, so
/// that evidence against the second perception is included: the second is better in another way,
/// only the second fails, both collide, both arrive with the greatest difference in time, any
/// other. Then more seeds follow in the same order.
std::vector<std::uint64_t> telling_seeds(const std::vector<TrialResult>& results,
                                         const std::pair<std::string, std::string>& perceptions,
                                         int most);

}  // namespace blindcorner
