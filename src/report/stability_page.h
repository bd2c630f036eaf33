// SPDX-License-Identifier: Apache-2.0
/// The table of stiff and extreme cases, as a page and as JSON.
#pragma once

#include <string>
#include <vector>

#include "stability/stability.h"

namespace blindcorner {

/// `blindcorner.stability/1`.
std::string stability_json(const std::vector<StabilityResult>& results);

/// One table per theme, rows that fail marked.
std::string stability_page(const std::vector<StabilityResult>& results);

}  // namespace blindcorner
