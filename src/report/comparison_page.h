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

/// A bird's-eye view of one scene's answers, and its title.
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
  /// How the captures were simulated. Empty: they were measured, and methods learn some of them and
  /// are evaluated on the others.
  std::optional<ComparisonOptions> simulated;
  std::uint64_t seed = 1;
  std::vector<PublishedFigure> published;
};

/// What all figures mean: which errors they are, and by which convention. A sentence each.
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
