// SPDX-License-Identifier: Apache-2.0
/// A comparison of methods: page, table for a terminal, CSV and JSON.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "blindcorner/simulation/comparison.h"

namespace blindcorner {

/// Bird's-eye views of one scene's answers, a title each.
struct ComparisonPicture {
  std::string title, svg;
};

/// A figure from elsewhere that stands beside the measured ones.
struct PublishedFigure {
  std::string name;
  double rmse = 0;  ///< m, over all coordinates of position
};

struct ComparisonReport {
  std::vector<SceneComparison> scenes;
  std::vector<std::vector<ComparisonPicture>> pictures;  ///< [scenes]
  /// How captures were simulated; empty: they were measured, and learnt or evaluated by turns.
  std::optional<ComparisonOptions> simulated;
  std::uint64_t seed = 1;
  std::vector<PublishedFigure> published;
};

/// What all figures mean, a sentence each: which errors, whose convention.
std::vector<std::string> comparison_conventions(const ComparisonReport& report);

/// A row for each condition and method of one scene.
std::string comparison_text(const SceneComparison& comparison);

/// `scene,condition,method,captures,failures,position_median_m,...`; empty cells where a scene
/// lacks an unknown or a method claims no region.
std::string comparison_csv(const std::vector<SceneComparison>& scenes);

/// "blindcorner.comparison/2" (docs/compare.md). What is not finite is null.
nlohmann::ordered_json comparison_json(const ComparisonReport& report);

/// One self-contained page.
std::string comparison_page(const ComparisonReport& report);

}  // namespace blindcorner
