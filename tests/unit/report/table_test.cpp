// SPDX-License-Identifier: Apache-2.0
#include "report/table.h"

#include <gmock/gmock.h>

#include <cmath>

namespace blindcorner {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::vector<TableRow> two_rows() {
  return {{{{"name", "name", "%-6s", "a"},
            {"error_m", "error mm", "%7.1f", 0.0123456789, 1e3},
            {"count", "n", "%4d", 12},
            {"holds", "", "", true},
            {"", "verdict", "%8s", "holds"}}},
          {{{"name", "name", "%-6s", "b, c"},
            {"error_m", "error mm", "%7.1f", std::nan(""), 1e3},
            {"count", "n", "%4d", nullptr},
            {"holds", "", "", false},
            {"", "verdict", "%8s", "FAILS"}},
           true}};
}

// A column is as wide as its pattern says, or as its heading where that is wider.
TEST(Table, LinesStandBelowTheirHeadings) {
  EXPECT_EQ(table_text(two_rows()),
            "name   error mm    n  verdict\n"
            "a          12.3   12    holds\n"
            "b, c          -    -    FAILS\n");
  EXPECT_EQ(table_text({}), "");
}

// Programs get the values themselves, not what readers see of them.
TEST(Table, CsvHasTheKeysAndUnscaledValues) {
  EXPECT_EQ(table_csv(two_rows()),
            "name,error_m,count,holds\n"
            "a,0.0123457,12,1\n"
            "\"b, c\",,,0\n");
  std::vector<TableRow> quoted = two_rows();
  quoted[0].fields[0].value = "6\" pipe";
  EXPECT_THAT(table_csv(quoted), HasSubstr("\n\"6\"\" pipe\",0.0123457,12,1\n"));
}

TEST(Table, JsonHasAllDigitsAndNullsWhereNothingIsTold) {
  const TableCell rows = table_json(two_rows());
  EXPECT_EQ(rows[0]["error_m"], 0.0123456789);
  EXPECT_EQ(rows[0]["holds"], true);
  EXPECT_EQ(rows[0].size(), 4U);
  EXPECT_TRUE(rows[1]["error_m"].is_null());
  EXPECT_TRUE(rows[1]["count"].is_null());
}

TEST(Table, PagesMarkRowsThatFailAndHoldSafeText) {
  std::vector<TableRow> rows = two_rows();
  rows[0].fields[0].value = "<a>";
  const std::string html = table_html(rows);
  EXPECT_THAT(html, HasSubstr("<tr><td>&lt;a&gt;<td>12.3<td>12<td>holds</tr>"));
  EXPECT_THAT(html, HasSubstr("font-weight:600\"><td>b, c<td>-"));
  EXPECT_THAT(html, Not(HasSubstr("holds<td>")));
}

}  // namespace
}  // namespace blindcorner
