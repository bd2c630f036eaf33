// SPDX-License-Identifier: Apache-2.0
/// Claims beside what was found, for pages, terminals and programs.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "blindcorner/simulation/claim_tests.h"

namespace blindcorner {

/// A table with a verdict in each row; rows that fail are marked.
std::string claim_table_html(std::span<const ClaimTest> claims);
std::string claim_table_text(std::span<const ClaimTest> claims);
/// `claim,trials,claimed,found,allowed_low,allowed_high,holds`.
std::string claim_csv_header();
std::string claim_csv(const ClaimTest& claim);
nlohmann::ordered_json claim_json(const ClaimTest& claim);

}  // namespace blindcorner
