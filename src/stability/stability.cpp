// SPDX-License-Identifier: Apache-2.0
#include "stability/stability.h"

#include <cmath>
#include <ctime>
#include <exception>
#include <iterator>
#include <utility>

#include "stability/themes.h"

namespace blindcorner {

std::string limit_origin_name(LimitOrigin origin) {
  return origin == LimitOrigin::physics ? "physics" : "arithmetic";
}

const std::vector<StabilityRow>& stability_rows() {
  static const std::vector<StabilityRow> all = [] {
    std::vector<StabilityRow> rows;
    for (auto* theme : {&pulse_rows, &geometry_rows, &scale_rows, &photon_rows, &inference_rows,
                        &bright_rows, &assumption_rows, &learning_rows, &driving_rows}) {
      std::vector<StabilityRow> more = theme();
      rows.insert(rows.end(), std::make_move_iterator(more.begin()),
                  std::make_move_iterator(more.end()));
    }
    return rows;
  }();
  return all;
}

StabilityResult run_stability_row(const StabilityRow& row) {
  StabilityResult result;
  result.row = &row;
  const std::clock_t start = std::clock();
  try {
    result.measured = row.measure();
  } catch (const std::exception& error) {
    result.measured = {std::nan(""), error.what()};
  }
  result.seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  result.holds = std::isfinite(result.measured.value) && result.measured.value <= row.limit;
  return result;
}

}  // namespace blindcorner
