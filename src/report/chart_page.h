// SPDX-License-Identifier: Apache-2.0
/// Studies as pictures: a self-contained HTML page of charts with logarithmic axes.
#pragma once

#include <string>
#include <vector>

namespace blindcorner {

struct ChartPoint {
  double x = 0, y = 0;  ///< both > 0; others are not drawn
  std::string label;    ///< shown when pointed at
};

struct ChartSeries {
  std::string name;
  std::vector<ChartPoint> points;
  bool line = true;  ///< joined; else marks only
};

/// A horizontal or vertical line across a chart.
struct ChartRule {
  std::string name;
  double at = 0;
  bool vertical = false;
};

struct StudyChart {
  std::string title, x_name, y_name;
  std::vector<ChartSeries> series;
  std::vector<ChartRule> rules;
};

/// The page: title, a paragraph that says what is drawn, the charts.
std::string chart_page(const std::string& title, const std::string& text,
                       const std::vector<StudyChart>& charts);

}  // namespace blindcorner
