// SPDX-License-Identifier: Apache-2.0
/// Line charts as SVG, for pages that need no script.
#pragma once

#include <string>
#include <vector>

namespace blindcorner {

struct ChartPoint {
  double x = 0, y = 0;  ///< what is not finite, or not > 0 on logarithmic axes, is not drawn
  std::string label{};  ///< shown beside the values when the point is pointed at
};

enum class SeriesStyle {
  line,
  marked_line,  ///< with a dot at each point that tells its values when pointed at
  dots,
  circles,        ///< that tell their values when pointed at
  marks,          ///< filled circles that tell their values when pointed at
  labelled_line,  ///< with the points' labels beside them
};

struct ChartSeries {
  std::string name;  ///< in the legend; empty: no entry
  std::vector<ChartPoint> points{};
  SeriesStyle style = SeriesStyle::line;
  std::string colour{};  ///< CSS; empty: from the palette, by the place among the chart's series
};

/// A dashed line across a chart.
struct ChartRule {
  std::string name;
  double at = 0;
  bool vertical = false;
};

struct Chart {
  std::string title;
  std::string x_label, y_label;
  std::vector<ChartSeries> series{};
  std::vector<ChartRule> rules{};
  bool logarithmic = false;       ///< both axes
  bool logarithmic_y = false;     ///< the vertical axis
  int width = 360, height = 240;  ///< pixels
};

/// One <svg> element.
std::string chart_svg(const Chart& chart);

/// A block of charts, as many side by side as fit on the page.
std::string charts_html(const std::vector<Chart>& charts);

}  // namespace blindcorner
