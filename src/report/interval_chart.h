// SPDX-License-Identifier: Apache-2.0
/// Values with their intervals, a row for each case and a mark for each method, as SVG.
#pragma once

#include <string>
#include <vector>

namespace blindcorner {

struct IntervalMark {
  std::string name;  ///< in the legend, which is made of all rows' names
  double value = 0, low = 0, high = 0;
};

struct IntervalRow {
  std::string label;
  std::vector<IntervalMark> marks;  ///< those not finite or not > 0 are not drawn
};

/// One <svg> element with a logarithmic axis to the right.
std::string intervals_svg(const std::string& axis, const std::vector<IntervalRow>& rows);

}  // namespace blindcorner
