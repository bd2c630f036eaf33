// SPDX-License-Identifier: Apache-2.0
#include "report/interval_chart.h"

#include <algorithm>
#include <cmath>

#include "report/colours.h"
#include "report/formatted.h"
#include "report/html.h"

namespace blindcorner {
namespace {

// Pixels.
constexpr double kLeft = 210, kRight = 20, kWidth = 900, kBottom = 42;
constexpr double kLegendLine = 16, kUnderLegend = 28;
constexpr double kMarkStep = 9, kRowGap = 9;

/// The axis from the smallest to the largest end of an interval.
struct LogAxis {
  double low = 1e300, high = 0;

  void include(double v) {
    if (!(v > 0) || !std::isfinite(v)) return;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  double pixel(double v) const {
    const double share = std::log(std::max(v, low) / low) / std::log(high / low);
    return kLeft + share * (kWidth - kLeft - kRight);
  }
};

LogAxis axis_of(const std::vector<IntervalRow>& rows) {
  LogAxis axis;
  for (const IntervalRow& row : rows) {
    for (const IntervalMark& mark : row.marks) {
      for (const double v : {mark.value, mark.low, mark.high}) axis.include(v);
    }
  }
  if (axis.high <= 0) return {0.1, 10};
  return {axis.low / 1.15, axis.high * 1.15};
}

std::vector<std::string> names_of(const std::vector<IntervalRow>& rows) {
  std::vector<std::string> names;
  for (const IntervalRow& row : rows) {
    for (const IntervalMark& mark : row.marks) {
      if (std::ranges::find(names, mark.name) == names.end()) names.push_back(mark.name);
    }
  }
  return names;
}

struct Legend {
  std::string svg;
  double height = kLegendLine;
};

/// Names in as many lines as they need.
Legend legend(const std::vector<std::string>& names) {
  Legend legend;
  double x = kLeft;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const double width = 34 + 6.5 * static_cast<double>(names[i].size());
    if (x > kLeft && x + width > kWidth) {
      x = kLeft;
      legend.height += kLegendLine;
    }
    const double y = legend.height - 2;
    legend.svg += formatted("<circle cx=\"%.0f\" cy=\"%.0f\" r=\"4\" fill=\"%s\"/>", x, y,
                            colour::of_method(names[i], i).c_str()) +
                  formatted("<text x=\"%.0f\" y=\"%.0f\">", x + 9, y + 4) + html_safe(names[i]) +
                  "</text>";
    x += width;
  }
  return legend;
}

/// Lines at 1, 2 and 5 times powers of ten.
std::string grid(const LogAxis& axis, double top, double bottom) {
  std::string svg;
  for (int d = -9; d <= 9; ++d) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double v = factor * std::pow(10.0, d);
      if (v < axis.low || v > axis.high) continue;
      svg += formatted("<path stroke=\"var(--grid,#e7ebee)\" d=\"M%.1f %.0fV%.1f\"/>",
                       axis.pixel(v), top, bottom) +
             formatted("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%g</text>",
                       axis.pixel(v), bottom + 14, v);
    }
  }
  return svg;
}

std::string mark_svg(const IntervalMark& mark, const LogAxis& axis, double y,
                     const std::string& colour) {
  if (!(mark.value > 0) || !std::isfinite(mark.value)) return {};
  std::string svg = formatted("<path stroke=\"%s\" stroke-width=\"1.6\" d=\"M%.1f %.1fH%.1f\"/>",
                              colour.c_str(), axis.pixel(mark.low), y, axis.pixel(mark.high));
  svg += formatted("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3.6\" fill=\"%s\"><title>",
                   axis.pixel(mark.value), y, colour.c_str());
  return svg + html_safe(mark.name) +
         formatted(": %.4g (%.4g to %.4g)</title></circle>\n", mark.value, mark.low, mark.high);
}

}  // namespace

std::string intervals_svg(const std::string& axis_label, const std::vector<IntervalRow>& rows) {
  const LogAxis axis = axis_of(rows);
  const std::vector<std::string> names = names_of(rows);
  const Legend head = legend(names);
  const double top = head.height + kUnderLegend;
  double y = top;
  std::string marks;
  for (const IntervalRow& row : rows) {
    const double height = kMarkStep * static_cast<double>(std::max<std::size_t>(names.size(), 1));
    marks +=
        formatted("<text x=\"%.0f\" y=\"%.1f\" text-anchor=\"end\">", kLeft - 10, y + height / 2) +
        html_safe(row.label) + "</text>";
    for (const IntervalMark& mark : row.marks) {
      const auto name =
          static_cast<std::size_t>(std::ranges::find(names, mark.name) - names.begin());
      marks += mark_svg(mark, axis, y + kMarkStep * static_cast<double>(name),
                        colour::of_method(mark.name, name));
    }
    y += height + kRowGap;
    marks += formatted("<path stroke=\"var(--grid,#e7ebee)\" d=\"M0 %.1fH%.0f\"/>",
                       y - 0.5 * kRowGap - 4, kWidth - kRight);
  }
  const std::string label = html_safe(axis_label);
  return scroll_box("chart: " + label) +
         formatted(
             "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" "
             "width=\"%.0f\" role=\"img\" aria-label=\"%s\" font-family=\"sans-serif\" "
             "font-size=\"11\">",
             kWidth, y + kBottom, kWidth, label.c_str()) +
         head.svg + grid(axis, top - 10, y) + marks +
         formatted("<text x=\"%.0f\" y=\"%.1f\" text-anchor=\"middle\">", 0.5 * (kLeft + kWidth),
                   y + 32) +
         label + "</text></svg></div>\n";
}

}  // namespace blindcorner
