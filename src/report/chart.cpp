// SPDX-License-Identifier: Apache-2.0
#include "report/chart.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace blindcorner {
namespace {

struct Range {
  double low = 1e300, high = -1e300;
  void add(double v) {
    if (!std::isfinite(v)) return;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  void settle() {
    if (low > high) low = 0, high = 1;
    if (high - low < 1e-12) high = low + 1;
  }
};

/// A step of 1, 2 or 5 times a power of ten that gives about four ticks.
double tick_step(double span) {
  const double power = std::pow(10.0, std::floor(std::log10(span / 4)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (span / (factor * power) <= 5) return factor * power;
  }
  return 10 * power;
}

std::string text_number(double v) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", std::abs(v) < 1e-12 ? 0.0 : v);
  return text;
}

template <typename... Args>
std::string format(const char* pattern, Args... args) {
  char text[512];
  std::snprintf(text, sizeof text, pattern, args...);
  return text;
}

}  // namespace

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string chart_svg(const Chart& chart) {
  constexpr double kLeft = 52, kRight = 10, kTop = 24, kBottom = 38;
  Range x, y;
  for (const ChartLine& line : chart.lines) {
    for (const auto& [px, py] : line.points) {
      x.add(px);
      y.add(py);
    }
  }
  x.settle();
  y.settle();
  const double margin = 0.05 * (y.high - y.low);
  y.high += margin;
  if (y.low != 0) y.low -= margin;
  const double w = chart.width - kLeft - kRight;
  const double h = chart.height - kTop - kBottom;
  const auto px = [&](double v) { return kLeft + w * (v - x.low) / (x.high - x.low); };
  const auto py = [&](double v) { return kTop + h * (1 - (v - y.low) / (y.high - y.low)); };
  std::string svg = format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" "
      "font-family=\"sans-serif\" "
      "font-size=\"11\">",
      chart.width, chart.height);
  svg += format("<text x=\"%.0f\" y=\"14\" font-size=\"12\">", kLeft) + escaped(chart.title) +
         "</text>";
  for (double t = std::ceil(x.low / tick_step(x.high - x.low)) * tick_step(x.high - x.low);
       t <= x.high + 1e-9 * (x.high - x.low); t += tick_step(x.high - x.low)) {
    svg += format("<path d=\"M%.1f %.1fV%.1f\" stroke=\"#ddd\"/>", px(t), kTop, kTop + h);
    svg += format("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">", px(t), kTop + h + 14) +
           text_number(t) + "</text>";
  }
  for (double t = std::ceil(y.low / tick_step(y.high - y.low)) * tick_step(y.high - y.low);
       t <= y.high + 1e-9 * (y.high - y.low); t += tick_step(y.high - y.low)) {
    svg += format("<path d=\"M%.1f %.1fH%.1f\" stroke=\"#ddd\"/>", kLeft, py(t), kLeft + w);
    svg += format("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">", kLeft - 4, py(t) + 4) +
           text_number(t) + "</text>";
  }
  double legend = kTop + 12;
  for (const ChartLine& line : chart.lines) {
    if (line.dots) {
      for (const auto& [a, b] : line.points) {
        if (!std::isfinite(a) || !std::isfinite(b)) continue;
        svg += format("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"2\" fill=\"%s\"/>", px(a), py(b),
                      line.colour.c_str());
      }
    } else {
      std::string path;
      for (const auto& [a, b] : line.points) {
        if (!std::isfinite(a) || !std::isfinite(b)) continue;
        path += format("%s%.1f %.1f", path.empty() ? "M" : "L", px(a), py(b));
      }
      svg += "<path fill=\"none\" stroke-width=\"1.5\" stroke=\"" + line.colour + "\" d=\"" + path +
             "\"/>";
    }
    if (!line.label.empty()) {
      svg += format("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\" fill=\"%s\">", kLeft + w - 4,
                    legend, line.colour.c_str()) +
             escaped(line.label) + "</text>";
      legend += 13;
    }
  }
  svg +=
      format("<text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">", kLeft + w / 2, chart.height - 6) +
      escaped(chart.x_label) + "</text>";
  svg += format("<text transform=\"translate(11,%.1f) rotate(-90)\" text-anchor=\"middle\">",
                kTop + h / 2) +
         escaped(chart.y_label) + "</text>";
  return svg + "</svg>";
}

std::string simple_page(const std::string& title, const std::string& body) {
  return "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>" + escaped(title) +
         "</title>\n<style>body{font:14px sans-serif;margin:1.5em;max-width:78em}"
         "table{border-collapse:collapse;margin:1em 0}td,th{padding:2px 10px;text-align:right;"
         "border-bottom:1px solid #ddd}td:first-child,th:first-child{text-align:left}"
         ".open{color:#999}</style>\n<h1>" +
         escaped(title) + "</h1>\n" + body + "</html>\n";
}

}  // namespace blindcorner
