// SPDX-License-Identifier: Apache-2.0
/// Error against run time: page, table for a terminal, CSV and JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "blindcorner/simulation/solver_sweep.h"

namespace blindcorner {

struct SweepReport {
  SweepOptions options;
  std::vector<SweepScene> scenes;
  SweepVerdict verdict;
};

/// A row for each method at each level of light of one scene.
std::string sweep_text(const SweepScene& scene);
/// A row for each scene, level of light and method (docs/benchmark.md).
std::string sweep_csv(const SweepReport& report);
/// "blindcorner.sweep/1". What is not finite is null.
nlohmann::ordered_json sweep_json(const SweepReport& report);
/// Median error against the time of a following capture: a row of pictures for each scene.
std::string sweep_svg(const SweepReport& report);
/// One self-contained page.
std::string sweep_page(const SweepReport& report);

}  // namespace blindcorner
