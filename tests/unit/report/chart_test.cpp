// SPDX-License-Identifier: Apache-2.0
#include "report/chart.h"

#include <gmock/gmock.h>

namespace blindcorner {
namespace {

using ::testing::HasSubstr;

TEST(Chart, PointsThatLieTogetherShareALabel) {
  Chart chart{"title", "x", "y"};
  chart.series.push_back({"series",
                          {{0, 0, "a"}, {0.001, 0, "b"}, {1, 0, "c"}, {1, 1, "d"}},
                          SeriesStyle::labelled_line});
  const std::string svg = chart_svg(chart);
  for (const char* label : {">a, b</text>", ">c</text>", ">d</text>"}) {
    EXPECT_THAT(svg, HasSubstr(label));
  }
}

TEST(Chart, LabelsOfTwoSeriesAtOnePlaceAreOnLinesOfTheirOwn) {
  Chart chart{"title", "x", "y"};
  for (const char* name : {"first", "second"}) {
    chart.series.push_back({name, {{0, 0, name}, {1, 1, "end"}}, SeriesStyle::labelled_line});
  }
  const std::string svg = chart_svg(chart);
  const auto height_of = [&](const std::string& label) {
    const std::size_t at = svg.rfind(" y=\"", svg.find(">" + label + "</text>", svg.find("<path")));
    return std::stod(svg.substr(at + 4));
  };
  EXPECT_NEAR(height_of("first") - height_of("second"), 12, 0.2);
}

}  // namespace
}  // namespace blindcorner
