// SPDX-License-Identifier: Apache-2.0
/// Grouped bars of shares as SVG, for pages that need no script.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "blindcorner/simulation/credible_level.h"

namespace blindcorner {

/// A share with its interval, if it has one.
struct Bar {
  std::string name;    ///< in the legend
  std::string colour;  ///< CSS
  double share = 0;
  std::optional<ShareInterval> interval;
};

struct BarGroup {
  std::string label;  ///< below it
  std::vector<Bar> bars;
};

/// One <svg> element: bars from 0 to 1, lines with caps for their intervals. Bars of one name have
/// one entry in the legend, whichever groups hold them.
std::string bars_svg(const std::string& title, const std::string& x_label,
                     const std::vector<BarGroup>& groups);

}  // namespace blindcorner
