// SPDX-License-Identifier: Apache-2.0
/// Claims beside what was found, for pages, terminals and programs.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "blindcorner/simulation/claim_study.h"
#include "report/table.h"

namespace blindcorner {

/// What is claimed of a scene at a level of light, and what was found. Scene and light are columns
/// for programs alone: on the terminal and on pages they stand above the table.
std::vector<TableRow> claim_rows(const Scene& scene, const ClaimLevel& level);

/// A number, or nothing for the scene's own exposure.
TableCell photons_cell(const ClaimLevel& level);
/// The rows of all levels of all scenes; `rows` makes those of one level.
template <class Level, class Base>
std::vector<TableRow> all_rows(const std::vector<StudyScene<Level>>& scenes,
                               std::vector<TableRow> (*rows)(const Scene&, const Base&)) {
  std::vector<TableRow> all;
  for (const StudyScene<Level>& scene : scenes) {
    for (const Level& level : scene.levels) {
      for (TableRow& row : rows(scene.scene, level)) all.push_back(std::move(row));
    }
  }
  return all;
}

/// Format, options and headline of a study, which begin its JSON file.
nlohmann::ordered_json study_json(const std::string& format, const ClaimStudyOptions& options,
                                  const std::string& headline);
/// Light and exposure of a level, which begin its entry.
nlohmann::ordered_json level_json(const ClaimLevel& level);
/// Scenes with their levels; `level` writes each level.
template <class Level>
nlohmann::ordered_json scenes_json(const std::vector<StudyScene<Level>>& scenes,
                                   nlohmann::ordered_json (*level)(const Scene&, const Level&)) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const StudyScene<Level>& scene : scenes) {
    nlohmann::ordered_json levels = nlohmann::ordered_json::array();
    for (const Level& one : scene.levels) levels.push_back(level(scene.scene, one));
    json.push_back(
        {{"scene", scene.scene.name}, {"file", scene.scene.path}, {"levels", std::move(levels)}});
  }
  return json;
}

/// What the verdicts of a page mean.
extern const char* const kJudgedTogether;

}  // namespace blindcorner
