// SPDX-License-Identifier: Apache-2.0
/// Whether the fit's uncertainty is what it says: page, table for a terminal, CSV and JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "blindcorner/simulation/coverage_study.h"

namespace blindcorner {

/// The sentence that stands first: how many claims hold.
std::string coverage_headline(const CoverageReport& report);
std::string coverage_text(const CoverageScene& scene);
/// A row for each scene and level of light: what it is, and whether all of its claims hold.
std::string coverage_summary(const CoverageReport& report);
/// A row for each claim (docs/benchmark.md).
std::string coverage_csv(const CoverageReport& report);
/// A row for each wrong assumption.
std::string wrong_assumptions_csv(const CoverageReport& report);
/// "blindcorner.coverage/1". What is not finite is null.
nlohmann::ordered_json coverage_json(const CoverageReport& report);
/// One self-contained page.
std::string coverage_page(const CoverageReport& report);

}  // namespace blindcorner
