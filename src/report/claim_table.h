// SPDX-License-Identifier: Apache-2.0
/// Claims beside what was found, for pages, terminals and programs.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "blindcorner/simulation/claim_study.h"

namespace blindcorner {

/// The beginning of a table's row; one that fails is marked.
std::string verdict_row(bool holds);
/// A table with a verdict in each row; rows that fail are marked.
std::string claim_table_html(std::span<const ClaimTest> claims);
std::string claim_table_text(std::span<const ClaimTest> claims);
nlohmann::ordered_json claims_json(std::span<const ClaimTest> claims);

/// A number, or nothing for the scene's own exposure.
std::string photons_csv(const ClaimLevel& level);
/// `claim,trials,claimed,found,allowed_low,allowed_high,holds`, a row each.
std::string claim_rows_csv(const Scene& scene, const ClaimLevel& level);
/// A row for each claim of a study, with its head.
template <class Level>
std::string claims_csv(const std::vector<StudyScene<Level>>& scenes) {
  std::string csv = "scene,photons,claim,trials,claimed,found,allowed_low,allowed_high,holds\n";
  for (const StudyScene<Level>& scene : scenes) {
    for (const Level& level : scene.levels) csv += claim_rows_csv(scene.scene, level);
  }
  return csv;
}

/// Format, options and headline of a study, which begin its JSON file.
nlohmann::ordered_json study_json(const std::string& format, const ClaimStudyOptions& options,
                                  const std::string& headline);
/// Light and exposure of a level, which begin its entry.
nlohmann::ordered_json level_json(const ClaimLevel& level);
/// Scenes with their levels, each as `level` writes it.
template <class Level>
nlohmann::ordered_json scenes_json(const std::vector<StudyScene<Level>>& scenes,
                                   nlohmann::ordered_json (*level)(const Level&)) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const StudyScene<Level>& scene : scenes) {
    nlohmann::ordered_json levels = nlohmann::ordered_json::array();
    for (const Level& one : scene.levels) levels.push_back(level(one));
    json.push_back(
        {{"scene", scene.scene.name}, {"file", scene.scene.path}, {"levels", std::move(levels)}});
  }
  return json;
}

/// What the verdicts of a page mean.
extern const char* const kJudgedTogether;

}  // namespace blindcorner
