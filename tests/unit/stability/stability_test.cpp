// SPDX-License-Identifier: Apache-2.0
/// Every row of the table of stiff and extreme cases, a test each.
#include "stability/stability.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

/// How much longer sanitizers may take.
#ifdef __SANITIZE_ADDRESS__
constexpr double kSlower = 5;
#else
constexpr double kSlower = 1;
#endif

/// Themes in the order of their first rows.
std::vector<std::string> themes() {
  std::vector<std::string> all;
  for (const StabilityRow& row : stability_rows()) {
    if (std::ranges::find(all, row.theme) == all.end()) all.push_back(row.theme);
  }
  return all;
}

/// The rows of a theme one after the other: they share the captures that they have made.
class StabilityRowsOf : public testing::TestWithParam<std::string> {};

TEST_P(StabilityRowsOf, Hold) {
  for (const StabilityRow& row : stability_rows()) {
    if (row.theme != GetParam()) continue;
    const StabilityResult result = run_stability_row(row);
    const bool late =
        kSlower > 1 && row.unit == "s" && result.measured.value <= kSlower * row.limit;
    EXPECT_TRUE(result.holds || late)
        << row.name << ": " << row.action << ": " << result.measured.value << " against "
        << row.limit << " " << result.measured.detail;
  }
}

std::string test_name(const testing::TestParamInfo<std::string>& info) {
  std::string name = info.param;
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  return name;
}

INSTANTIATE_TEST_SUITE_P(Stability, StabilityRowsOf, testing::ValuesIn(themes()), test_name);

TEST(StabilityTable, NamesItsRowsOnceAndSaysWhereLimitsComeFrom) {
  std::set<std::string> names;
  for (const StabilityRow& row : stability_rows()) {
    EXPECT_TRUE(names.insert(row.name).second) << row.name;
    EXPECT_FALSE(row.theme.empty() || row.action.empty() || row.unit.empty() || row.reason.empty())
        << row.name;
    EXPECT_GE(row.limit, 0) << row.name;
  }
}

StabilityResult result_of(double limit, std::function<StabilityMeasurement()> measure) {
  static StabilityRow row;
  row.limit = limit;
  row.measure = std::move(measure);
  return run_stability_row(row);
}

TEST(StabilityRow, HoldsUpToItsLimitAndNeverWithoutANumber) {
  EXPECT_TRUE(result_of(1, [] { return StabilityMeasurement{1, ""}; }).holds);
  EXPECT_FALSE(result_of(1, [] { return StabilityMeasurement{1.001, ""}; }).holds);
  EXPECT_FALSE(result_of(1, [] { return StabilityMeasurement{std::nan(""), ""}; }).holds);
  const StabilityResult thrown =
      result_of(1, []() -> StabilityMeasurement { throw Error("here", "why"); });
  EXPECT_FALSE(thrown.holds);
  EXPECT_EQ(thrown.measured.detail, "here: why");
}

}  // namespace
}  // namespace blindcorner
