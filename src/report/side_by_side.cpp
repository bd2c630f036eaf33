// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/report/side_by_side.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "blindcorner/forward/error.h"
#include "blindcorner/report/drive_report.h"
#include "blindcorner/report/result_file.h"
#include "report/html.h"

namespace blindcorner {
namespace {

using nlohmann::json;

/// The text with a capital first letter.
std::string capital(std::string text) {
  if (!text.empty() && text[0] >= 'a' && text[0] <= 'z') text[0] = static_cast<char>(text[0] - 32);
  return text;
}

std::string phrase_of(const json& replay) {
  return perception_phrase(replay.at("perception").get<std::string>());
}

std::string pair_headline(const json& first, const json& second) {
  const std::string vehicle = first.at("world").at("vehicle").at("kind").get<std::string>();
  return capital(phrase_of(first)) + " the " + vehicle + " " +
         first.at("ending").get<std::string>() + "; " + phrase_of(second) +
         ", in the same world, it " + second.at("ending").get<std::string>() + ".";
}

std::string outcomes_of(const json& replay) {
  return replay.at("perception").get<std::string>() + " " +
         replay.at("drive").at("outcome").get<std::string>();
}

/// A corner (0: lower, 1: upper) of the smallest rectangle that holds two rectangles.
json corner(const json& a, const json& b, std::size_t which) {
  json both = json::array();
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const double one = a.at(which).at(axis), other = b.at(which).at(axis);
    both.push_back(which == 0 ? std::min(one, other) : std::max(one, other));
  }
  return both;
}

/// What two drives through the same world show, the most telling first.
enum class Story { wins, saves, loses, both_collide, both_arrive, other };

Story story_of(const TrialResult& first, const TrialResult& second) {
  const auto collided = [](const TrialResult& r) { return r.outcome == "collision"; };
  if (collided(first) && second.reached()) return Story::wins;
  if (!first.reached() && second.reached()) return Story::saves;
  if (first.reached() && !second.reached()) return Story::loses;
  if (collided(first) && !collided(second)) return Story::saves;
  if (collided(first) && collided(second)) return Story::both_collide;
  return first.reached() ? Story::both_arrive : Story::other;
}

}  // namespace

json replay_pair(json first, json second, const std::pair<std::string, std::string>& pages) {
  const json seed = first.at("drive").at("seed");
  if (seed != second.at("drive").at("seed")) {
    throw Error("replay_pair", "found drives of two seeds, accepted: of one");
  }
  const json &a = first.at("extent_m"), &b = second.at("extent_m");
  json pair = {{"seed", seed},
               {"why", outcomes_of(first) + ", " + outcomes_of(second)},
               {"headline", pair_headline(first, second)},
               {"lower_m", corner(a, b, 0)},
               {"upper_m", corner(a, b, 1)}};
  for (json* replay : {&first, &second}) {
    (*replay)["name"] = capital(phrase_of(*replay));
    const std::string& page = replay == &first ? pages.first : pages.second;
    if (!page.empty()) (*replay)["page"] = page;
  }
  pair["drives"] = {std::move(first), std::move(second)};
  return pair;
}

namespace {

std::string part_of(const json& pairs, bool plays) {
  return "<div id=\"side-by-side\"></div>\n<noscript>The replay needs JavaScript.</noscript>\n" +
         script_part("pairs", dump_json({{"pairs", pairs}, {"plays", plays}}),
                     {.styles = {"player.css", "pair.css"},
                      .libraries = {"drive_map.js"},
                      .script = "pair_page.js"});
}

}  // namespace

std::string side_by_side_part(const json& pairs) { return part_of(pairs, false); }

std::string side_by_side_page(const std::string& title, const json& pairs) {
  return plain_page(title, pairs.at(0).at("headline"), part_of(pairs, true));
}

std::optional<std::pair<std::string, std::string>> telling_perceptions(
    const std::vector<TrialResult>& results) {
  const std::vector<std::string> names = perceptions_of(results);
  const auto driven = [&names](const char* name) { return std::ranges::count(names, name) > 0; };
  if (names.size() < 2) return {};
  const std::string first = driven("los") ? "los" : names[0];
  for (const char* name : {"solver", "cnn_wide", "cnn", "oracle"}) {
    if (driven(name) && first != name) return {{first, name}};
  }
  return {{first, first == names[0] ? names[1] : names[0]}};
}

std::vector<std::uint64_t> telling_seeds(const std::vector<TrialResult>& results,
                                         const std::pair<std::string, std::string>& perceptions,
                                         int most) {
  std::map<std::uint64_t, std::pair<const TrialResult*, const TrialResult*>> worlds;
  for (const TrialResult& result : results) {
    if (result.trial.error > 0 || result.trial.risk) continue;
    if (result.trial.perception == perceptions.first) worlds[result.trial.seed].first = &result;
    if (result.trial.perception == perceptions.second) worlds[result.trial.seed].second = &result;
  }
  std::map<Story, std::vector<std::pair<double, std::uint64_t>>> stories;
  for (const auto& [seed, both] : worlds) {
    if (both.first == nullptr || both.second == nullptr) continue;
    const Story story = story_of(*both.first, *both.second);
    // Where both arrive, the pair with the greatest difference in time comes first; else the pair
    // with the lowest seed.
    const double gap = story == Story::both_arrive ? both.second->time - both.first->time : 0.0;
    stories[story].emplace_back(-std::abs(gap), seed);
  }
  std::vector<std::uint64_t> seeds;
  for (auto& [story, list] : stories) std::ranges::sort(list);
  for (std::size_t round = 0, added = 1; added > 0; ++round) {
    added = 0;
    for (const auto& [story, list] : stories) {
      if (round >= list.size()) continue;
      ++added;
      if (std::ssize(seeds) < most) seeds.push_back(list[round].second);
    }
  }
  return seeds;
}

}  // namespace blindcorner
