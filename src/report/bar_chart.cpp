// SPDX-License-Identifier: Apache-2.0
#include "report/bar_chart.h"

#include <algorithm>
#include <set>

#include "report/formatted.h"
#include "report/html.h"

namespace blindcorner {
namespace {

// Pixels: the size of the picture, and its margins around the bars.
constexpr double kWidth = 900, kHeight = 300, kLeft = 50, kTop = 46, kBottom = 40;
constexpr double kWidestBar = 44;

/// Height at which a share is drawn, pixels from the top.
double y(double share) { return kTop + (1 - share) * (kHeight - kTop - kBottom); }

/// A line with caps, on a wider light line that keeps it visible on a bar of any colour.
std::string interval_svg(const ShareInterval& interval, double x) {
  const std::string d =
      formatted("d=\"M%.1f %.1fh8m-4 0V%.1fm-4 0h8\"/>", x - 4, y(interval.low), y(interval.high));
  return "<path class=\"interval\" fill=\"none\" stroke=\"var(--paper,#fff)\" stroke-width=\"4\" " +
         d + "<path fill=\"none\" stroke=\"var(--ink,#1b1f24)\" stroke-width=\"1.5\" " + d;
}

std::string bar_svg(const Bar& bar, double x, double width) {
  // A share of 0 is a line on the axis, not a place without a bar.
  const double height = std::max(y(0) - y(bar.share), 1.5);
  std::string svg =
      formatted("<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"%s\"><title>", x,
                y(0) - height, width, height, bar.colour.c_str()) +
      html_safe(bar.name) + formatted(": %.3f", bar.share);
  if (bar.interval) svg += formatted(" (%.3f to %.3f)", bar.interval->low, bar.interval->high);
  svg += "</title></rect>";
  if (bar.interval) svg += interval_svg(*bar.interval, x + width / 2);
  return svg;
}

/// `middle`: centre of the group's part of the picture, which is `step` pixels wide.
std::string group_svg(const BarGroup& group, double middle, double step) {
  std::string svg;
  const auto count = static_cast<double>(group.bars.size());
  const double width = std::min(0.8 * step / std::max(count, 1.0), kWidestBar);
  for (std::size_t i = 0; i < group.bars.size(); ++i) {
    svg += bar_svg(group.bars[i], middle + width * (static_cast<double>(i) - 0.5 * count + 0.05),
                   0.9 * width);
  }
  return svg +
         formatted("<text x=\"%.1f\" y=\"%.0f\" text-anchor=\"middle\">", middle,
                   kHeight - kBottom + 15) +
         html_safe(group.label) + "</text>";
}

/// The names of the bars of all groups, each name once.
std::string legend_svg(const std::vector<BarGroup>& groups) {
  std::string svg;
  std::set<std::string> named;
  double left = kLeft;
  for (const BarGroup& group : groups) {
    for (const Bar& bar : group.bars) {
      if (!named.insert(bar.name).second) continue;
      svg += formatted("<rect x=\"%.0f\" y=\"24\" width=\"10\" height=\"10\" fill=\"%s\"/>", left,
                       bar.colour.c_str()) +
             formatted("<text x=\"%.0f\" y=\"33\">", left + 14) + html_safe(bar.name) + "</text>";
      left += 34 + 6.5 * static_cast<double>(bar.name.size());
    }
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
  std::string svg =
      scroll_box("chart: " + html_safe(title)) +
      formatted(
          "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\" role=\"img\" "
          "aria-label=\"%s\" font-family=\"sans-serif\" font-size=\"11\"><text x=\"%.0f\" y=\"14\" "
          "font-size=\"12\" "
          "font-weight=\"600\">",
          kWidth, kHeight, html_safe(title).c_str(), kLeft);
  svg += html_safe(title) + "</text>" + legend_svg(groups) + scale_svg();
  const double step = (kWidth - kLeft) / static_cast<double>(groups.size());
  for (std::size_t g = 0; g < groups.size(); ++g) {
    svg += group_svg(groups[g], kLeft + step * (static_cast<double>(g) + 0.5), step);
  }
  return svg +
         formatted("<text x=\"%.0f\" y=\"%.0f\" text-anchor=\"middle\">", (kLeft + kWidth) / 2,
                   kHeight - 6) +
         html_safe(x_label) + "</text></svg></div>\n";
}

}  // namespace blindcorner
