// SPDX-License-Identifier: Apache-2.0
/// Small line charts as SVG, for pages that need no script.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace blindcorner {

struct ChartLine {
  std::string label;
  std::string colour;  ///< CSS
  std::vector<std::pair<double, double>> points;
  bool dots = false;  ///< points instead of a line
};

struct Chart {
  std::string title;
  std::string x_label, y_label;
  std::vector<ChartLine> lines;
  int width = 360, height = 240;
};

/// One <svg> element.
std::string chart_svg(const Chart& chart);

/// A self-contained HTML page.
std::string simple_page(const std::string& title, const std::string& body);

/// Text for HTML.
std::string escaped(const std::string& text);

}  // namespace blindcorner
