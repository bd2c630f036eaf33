// SPDX-License-Identifier: Apache-2.0
/// A comparison of methods: page, table for a terminal, CSV and JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "blindcorner/simulation/comparison.h"

namespace blindcorner {

/// Bird's-eye views of one scene's answers, a title each.
struct ComparisonPicture {
  std::string title, svg;
};

struct ComparisonReport {
  std::vector<SceneComparison> scenes;
  std::vector<std::vector<ComparisonPicture>> pictures;  ///< [scenes]
  ComparisonOptions options;
};

/// What all figures mean, a sentence each: which errors, whose convention.
std::vector<std::string> comparison_conventions();

/// A row for each condition and method of one scene.
std::string comparison_text(const SceneComparison& comparison);

/// `scene,condition,method,captures,failures,position_median_m,...`; empty cells where a scene
/// lacks an unknown or a method claims no region.
std::string comparison_csv(const std::vector<SceneComparison>& scenes);

/// "blindcorner.comparison/1" (docs/compare.md). What is not finite is null.
nlohmann::ordered_json comparison_json(const ComparisonReport& report);

/// One self-contained page.
std::string comparison_page(const ComparisonReport& report);

}  // namespace blindcorner
