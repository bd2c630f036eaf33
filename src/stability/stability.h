// SPDX-License-Identifier: Apache-2.0
/// The table of stiff and extreme cases: each row does one thing, measures one value and compares
/// it with a limit whose origin it states.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

namespace blindcorner {

/// Where a row's limit comes from.
enum class LimitOrigin { physics, arithmetic };
std::string limit_origin_name(LimitOrigin origin);

/// What a row measured. A value that is not finite fails.
struct StabilityMeasurement {
  double value = 0;
  std::string detail;  ///< one line for the reader; may be empty
};

struct StabilityRow {
  std::string name;    ///< lower case, words joined by "_"
  std::string theme;   ///< heading under which the row stands
  std::string action;  ///< what is done and what is measured
  double limit = 0;    ///< largest value that passes, in `unit`
  std::string unit;    ///< "1" for ratios and counts
  LimitOrigin origin = LimitOrigin::arithmetic;
  std::string reason;  ///< why the limit is what it is
  std::function<StabilityMeasurement()> measure;
};

/// A row that ran.
struct StabilityResult {
  const StabilityRow* row = nullptr;
  StabilityMeasurement measured;
  bool holds = false;
  double seconds = 0;  ///< processor time of all threads
};

/// All rows in the order of the table; names are unique.
const std::vector<StabilityRow>& stability_rows();

/// Measures a row. An exception makes it fail, with the message as its detail.
StabilityResult run_stability_row(const StabilityRow& row);

}  // namespace blindcorner
