// SPDX-License-Identifier: Apache-2.0
#include "report/bar_chart.h"

#include "report/formatted.h"
#include "report/html.h"

namespace blindcorner {
namespace {

// Pixels: of the picture, and of its margins around the bars.
constexpr double kWidth = 900, kHeight = 300, kLeft = 50, kTop = 46, kBottom = 40;

/// Where a share lies.
double y(double share) { return kTop + (1 - share) * (kHeight - kTop - kBottom); }

std::string bar_svg(const Bar& bar, double x, double width) {
  std::string svg =
      formatted("<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"%s\"><title>", x,
                y(bar.share), width, y(0) - y(bar.share), bar.colour.c_str()) +
      html_safe(bar.name) + formatted(": %.3f</title></rect>", bar.share);
  if (bar.interval) {
    svg += formatted("<path stroke=\"var(--ink,#1b1f24)\" d=\"M%.1f %.1fV%.1f\"/>", x + width / 2,
                     y(bar.interval->low), y(bar.interval->high));
  }
  return svg;
}

/// `left`: of the part of the picture, `step` pixels wide, that is the group's.
std::string group_svg(const BarGroup& group, double left, double step) {
  std::string svg;
  const double width = 0.8 * step / static_cast<double>(group.bars.size());
  for (std::size_t i = 0; i < group.bars.size(); ++i) {
    svg += bar_svg(group.bars[i], left + width * static_cast<double>(i), 0.9 * width);
  }
  return svg +
         formatted("<text x=\"%.1f\" y=\"%.0f\" text-anchor=\"middle\">", left + 0.4 * step,
                   kHeight - kBottom + 15) +
         html_safe(group.label) + "</text>";
}

std::string legend_svg(const std::vector<Bar>& bars) {
  std::string svg;
  double left = kLeft;
  for (const Bar& bar : bars) {
    svg += formatted("<rect x=\"%.0f\" y=\"24\" width=\"10\" height=\"10\" fill=\"%s\"/>", left,
                     bar.colour.c_str()) +
           formatted("<text x=\"%.0f\" y=\"33\">", left + 14) + html_safe(bar.name) + "</text>";
    left += 34 + 6.5 * static_cast<double>(bar.name.size());
  }
  return svg;
}

std::string scale_svg() {
  std::string svg;
  for (int tenth = 0; tenth <= 10; tenth += 2) {
    svg += formatted("<path stroke=\"var(--grid,#e7ebee)\" d=\"M%.0f %.1fH%.0f\"/>", kLeft,
                     y(0.1 * tenth), kWidth) +
           formatted("<text x=\"%.0f\" y=\"%.1f\" text-anchor=\"end\">%.1f</text>", kLeft - 4,
                     y(0.1 * tenth) + 4, 0.1 * tenth);
  }
  return svg;
}

}  // namespace

std::string bars_svg(const std::string& title, const std::string& x_label,
                     const std::vector<BarGroup>& groups) {
  std::string svg = formatted(
      "<div class=\"wide\"><svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" "
      "height=\"%.0f\" "
      "font-family=\"sans-serif\" font-size=\"11\"><text x=\"%.0f\" y=\"14\" font-size=\"12\" "
      "font-weight=\"600\">",
      kWidth, kHeight, kLeft);
  svg += html_safe(title) + "</text>" + legend_svg(groups.front().bars) + scale_svg();
  const double step = (kWidth - kLeft) / static_cast<double>(groups.size());
  for (std::size_t g = 0; g < groups.size(); ++g) {
    svg += group_svg(groups[g], kLeft + step * (static_cast<double>(g) + 0.1), step);
  }
  return svg +
         formatted("<text x=\"%.0f\" y=\"%.0f\" text-anchor=\"middle\">", kWidth / 2, kHeight - 6) +
         html_safe(x_label) + "</text></svg></div>\n";
}

}  // namespace blindcorner
