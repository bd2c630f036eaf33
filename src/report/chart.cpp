// SPDX-License-Identifier: Apache-2.0
#include "report/chart.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "report/colours.h"
#include "report/formatted.h"
#include "report/html.h"

namespace blindcorner {
namespace {

/// Room around the plot, pixels; the legend takes more above it.
constexpr double kLeft = 58, kRight = 12, kTop = 24, kBottom = 38;
constexpr double kLegendRow = 14, kLegendGap = 14;
/// Width of a letter, pixels, rounded up. The legend's rows and the places of rules' names need it.
constexpr double kLetter = 6.8;
constexpr double kLetterHeight = 13;
/// Labels of points, pixels: height of a line and width. Points that are nearer than both share a
/// label.
constexpr double kLabelLine = 12, kLabelWidth = 40;
/// About this many ticks fit on an axis.
constexpr int kTicks = 4;
constexpr int kMaxDecades = 8;

/// Values along one direction, and the pixels that they are drawn at.
class Axis {
 public:
  explicit Axis(bool logarithmic) : logarithmic_(logarithmic) {}

  bool shows(double v) const { return std::isfinite(v) && (!logarithmic_ || v > 0); }
  void include(double v) {
    if (!shows(v)) return;
    low_ = std::min(low_, v);
    high_ = std::max(high_, v);
  }
  /// Fixes the range. `margin` is the room at both ends of a linear axis, as a share of the range.
  /// A range that begins at zero gets no room there.
  void settle(double margin, double from_pixel, double to_pixel) {
    from_ = from_pixel;
    to_ = to_pixel;
    if (logarithmic_) {
      if (low_ > high_) low_ = 0.1, high_ = 10;
      low_ /= 1.4;
      high_ *= 1.4;
      return;
    }
    if (low_ > high_) low_ = 0, high_ = 1;
    if (high_ - low_ < 1e-12) high_ = low_ + 1;
    const double room = margin * (high_ - low_);
    high_ += room;
    if (low_ != 0) low_ -= room;
  }
  double pixel(double v) const {
    const double share =
        logarithmic_ ? std::log(v / low_) / std::log(high_ / low_) : (v - low_) / (high_ - low_);
    return from_ + (to_ - from_) * share;
  }
  std::vector<double> ticks() const { return logarithmic_ ? log_ticks() : linear_ticks(); }

 private:
  /// Steps of 1, 2 or 5 times a power of ten.
  std::vector<double> linear_ticks() const {
    const double span = high_ - low_;
    const double power = std::pow(10.0, std::floor(std::log10(span / kTicks)));
    double step = power;
    for (const double factor : {2.0, 5.0, 10.0}) {
      if (span / step > kTicks + 1) step = factor * power;
    }
    std::vector<double> ticks;
    for (double t = std::ceil(low_ / step); t * step <= high_ + 1e-9 * span; ++t) {
      ticks.push_back(t * step);
    }
    return ticks;
  }
  /// Powers of ten, some left out where there are many. Where fewer than two lie on the axis, the
  /// ticks are 1, 2 and 5 times each power.
  std::vector<double> log_ticks() const {
    const int first = static_cast<int>(std::floor(std::log10(low_)));
    const int last = static_cast<int>(std::ceil(std::log10(high_)));
    const int every = 1 + (last - first) / kMaxDecades;
    std::vector<double> ticks;
    const auto add = [&](double t) {
      if (t >= low_ && t <= high_) ticks.push_back(t);
    };
    for (int d = first; d <= last; ++d) {
      if (d % every == 0) add(std::pow(10.0, d));
    }
    if (ticks.size() > 1) return ticks;
    ticks.clear();
    for (int d = first; d <= last; ++d) {
      for (const double factor : {1.0, 2.0, 5.0}) add(factor * std::pow(10.0, d));
    }
    return ticks;
  }

  bool logarithmic_;
  double low_ = std::numeric_limits<double>::max(), high_ = -low_;
  double from_ = 0, to_ = 1;
};

std::string number(double v) { return formatted("%.6g", std::abs(v) < 1e-12 ? 0.0 : v); }

std::string colour_of(const Chart& chart, std::size_t i) {
  const std::string& own = chart.series[i].colour;
  return own.empty() ? colour::of_series(i) : own;
}

bool is_joined(SeriesStyle style) {
  return style == SeriesStyle::line || style == SeriesStyle::marked_line ||
         style == SeriesStyle::labelled_line;
}

struct Pixel {
  double x = 0, y = 0;
};

/// Pixels of those points of a series that can be drawn.
std::vector<Pixel> pixels_of(const ChartSeries& series, const Axis& x, const Axis& y) {
  std::vector<Pixel> pixels;
  for (const ChartPoint& p : series.points) {
    if (x.shows(p.x) && y.shows(p.y)) pixels.push_back({x.pixel(p.x), y.pixel(p.y)});
  }
  return pixels;
}

/// Whether a chart shows anything of a series.
bool is_drawn(const Chart& chart, const ChartSeries& series) {
  const Axis x(chart.logarithmic), y(chart.logarithmic || chart.logarithmic_y);
  return std::ranges::any_of(series.points,
                             [&](const ChartPoint& p) { return x.shows(p.x) && y.shows(p.y); });
}

/// Writes the names of the drawn series in their colours, in rows from the left. Returns the height
/// of the rows.
double add_legend(const Chart& chart, std::string& svg) {
  double x = 0, height = 0;
  for (std::size_t i = 0; i < chart.series.size(); ++i) {
    const std::string& name = chart.series[i].name;
    if (name.empty() || !is_drawn(chart, chart.series[i])) continue;
    const double width = kLegendGap + kLetter * static_cast<double>(name.size());
    const bool new_row = x == 0 || kLeft + x + width > chart.width;
    if (new_row) {
      if (height > 0) svg += "</text>";
      svg += formatted("<text x=\"%.0f\" y=\"%.0f\">", kLeft, kTop + height + 4);
      height += kLegendRow;
      x = 0;
    }
    svg += formatted("<tspan dx=\"%.0f\" style=\"fill:%s\">", new_row ? 0.0 : kLegendGap,
                     colour_of(chart, i).c_str()) +
           html_safe(name) + "</tspan>";
    x += width;
  }
  if (height > 0) svg += "</text>";
  return height;
}

/// A label under a tick, moved to the left where it would leave the picture.
std::string tick_label(const std::string& text, double x, double y, double width) {
  constexpr double kDigit = 6.5;  // px, width of a digit of the charts' font, rounded up
  const bool beyond = x + 0.5 * kDigit * static_cast<double>(text.size()) > width;
  return formatted("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\">", beyond ? width - 1 : x, y,
                   beyond ? "end" : "middle") +
         text + "</text>";
}

void add_axes(const Chart& chart, const Axis& x, const Axis& y, double top, std::string& svg) {
  const double right = chart.width - kRight, bottom = chart.height - kBottom;
  for (const double t : x.ticks()) {
    svg += formatted("<path d=\"M%.1f %.1fV%.1f\" stroke=\"%s\"/>", x.pixel(t), top, bottom,
                     colour::kGrid) +
           tick_label(number(t), x.pixel(t), bottom + 14, chart.width);
  }
  for (const double t : y.ticks()) {
    svg +=
        formatted("<path d=\"M%.1f %.1fH%.1f\" stroke=\"%s\"/>", kLeft, y.pixel(t), right,
                  colour::kGrid) +
        formatted("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">", kLeft - 4, y.pixel(t) + 4) +
        number(t) + "</text>";
  }
  svg += formatted("<path d=\"M%.1f %.1fV%.1fH%.1f\" stroke=\"%s\" fill=\"none\"/>", kLeft, top,
                   bottom, right, colour::kLine) +
         formatted("<text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">", (kLeft + right) / 2,
                   chart.height - 6) +
         html_safe(chart.x_label) + "</text>" +
         formatted("<text transform=\"translate(11,%.1f) rotate(-90)\" text-anchor=\"middle\">",
                   (top + bottom) / 2) +
         html_safe(chart.y_label) + "</text>";
}

void add_rule(const Chart& chart, const ChartRule& rule, const Axis& x, const Axis& y, double top,
              std::string& svg) {
  constexpr const char* kDashes = "stroke=\"var(--line,#8b949d)\" stroke-dasharray=\"5 4\"";
  const double right = chart.width - kRight, bottom = chart.height - kBottom;
  if (!(rule.vertical ? x : y).shows(rule.at)) return;
  svg +=
      rule.vertical
          ? formatted("<path d=\"M%.1f %.1fV%.1f\" %s/>", x.pixel(rule.at), top, bottom, kDashes)
          : formatted("<path d=\"M%.1f %.1fH%.1f\" %s/>", kLeft, y.pixel(rule.at), right, kDashes);
}

/// A rectangle of pixels, from its lower left corner.
struct Box {
  double left = 0, base = 0, width = 0;

  bool holds(const Pixel& p) const {
    return p.x > left && p.x < left + width && p.y > base - kLetterHeight && p.y < base + 2;
  }
};

/// How much of the drawing lies in a box: points, and places along the lines between them.
int crossings(const Chart& chart, const Axis& x, const Axis& y, const Box& box) {
  constexpr int kPlaces = 64;  // along a line from one point to the next
  int count = 0;
  for (const ChartSeries& series : chart.series) {
    const std::vector<Pixel> pixels = pixels_of(series, x, y);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      count += box.holds(pixels[i]) ? kPlaces : 0;
      if (i == 0 || !is_joined(series.style)) continue;
      for (int k = 1; k < kPlaces; ++k) {
        const double share = static_cast<double>(k) / kPlaces;
        const Pixel &from = pixels[i - 1], &to = pixels[i];
        const Pixel at{from.x + share * (to.x - from.x), from.y + share * (to.y - from.y)};
        count += box.holds(at) ? 1 : 0;
      }
    }
  }
  return count;
}

/// Writes the rule's name where it covers least of the curves, with an edge in the colour of the
/// paper.
void add_rule_name(const Chart& chart, const ChartRule& rule, const Axis& x, const Axis& y,
                   double top, std::string& svg) {
  if (!(rule.vertical ? x : y).shows(rule.at)) return;
  const double right = chart.width - kRight, bottom = chart.height - kBottom;
  const double width = kLetter * static_cast<double>(rule.name.size());
  std::vector<Box> places;
  if (rule.vertical) {
    const double at = x.pixel(rule.at);
    for (const double base : {top + 10, bottom - 4, (top + bottom) / 2}) {
      if (at + 3 + width < right) places.push_back({at + 3, base, width});
      if (at - 3 - width > kLeft) places.push_back({at - 3 - width, base, width});
    }
  } else {
    const double at = y.pixel(rule.at);
    for (const double base : {at - 4, at + kLetterHeight}) {
      if (base - kLetterHeight < top || base > bottom) continue;
      for (const double left : {right - 3 - width, kLeft + 3, (kLeft + right - width) / 2}) {
        places.push_back({left, base, width});
      }
    }
  }
  if (places.empty()) places.push_back({kLeft + 3, top + 10, width});
  const Box best = *std::ranges::min_element(
      places, {}, [&](const Box& box) { return crossings(chart, x, y, box); });
  svg += formatted(
             "<text x=\"%.1f\" y=\"%.1f\" stroke=\"%s\" stroke-width=\"3\" "
             "paint-order=\"stroke\" stroke-linejoin=\"round\">",
             best.left, best.base, colour::kPaper) +
         html_safe(rule.name) + "</text>";
}

/// Shown when the point is pointed at.
std::string point_title(const Chart& chart, const ChartSeries& series, const ChartPoint& point) {
  return "><title>" + html_safe(series.name) +
         (point.label.empty() ? "" : ", " + html_safe(point.label)) + "\n" +
         html_safe(chart.x_label) + formatted(": %.3g\n", point.x) + html_safe(chart.y_label) +
         formatted(": %.3g</title>", point.y);
}

/// Labels beside the points of one series. Points that lie together share a label.
class Labels {
 public:
  void add(double x, double y, const std::string& text) {
    if (!all_.empty() && std::abs(x - all_.back().x) < kLabelWidth &&
        std::abs(y - all_.back().y) < kLabelLine) {
      all_.back().text += ", " + text;
    } else {
      all_.push_back({x, y, text});
    }
  }
  /// The labels of each further series stand a line higher, so that they do not cover those of
  /// another series. A label that would leave the picture at the top stands below its point.
  std::string text(const Chart& chart, const std::string& colour, std::size_t series) const {
    std::string svg;
    for (const Label& label : all_) {
      const bool near_right = label.x > 0.7 * chart.width;
      const double above = label.y - 5 - kLabelLine * static_cast<double>(series);
      svg += formatted("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\" style=\"fill:%s\">",
                       near_right ? label.x - 5 : label.x + 5,
                       above > kTop + kLetterHeight ? above : label.y + 14,
                       near_right ? "end" : "start", colour.c_str()) +
             html_safe(label.text) + "</text>";
    }
    return svg;
  }

 private:
  struct Label {
    double x, y;
    std::string text;
  };
  std::vector<Label> all_;
};

void add_series(const Chart& chart, std::size_t i, const Axis& x, const Axis& y, std::string& svg) {
  const ChartSeries& series = chart.series[i];
  const std::string colour = colour_of(chart, i);
  std::string path;
  std::string marks;
  Labels labels;
  for (const ChartPoint& p : series.points) {
    if (!x.shows(p.x) || !y.shows(p.y)) continue;
    const double px = x.pixel(p.x), py = y.pixel(p.y);
    path += formatted("%s%.1f %.1f", path.empty() ? "M" : "L", px, py);
    const bool open = series.style == SeriesStyle::circles;
    const char* radius = open ? "4.5" : series.style == SeriesStyle::marks ? "3" : "2";
    marks += formatted("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"%s\" %s=\"%s\"", px, py, radius,
                       open ? "fill=\"none\" stroke" : "fill", colour.c_str());
    if (series.style == SeriesStyle::labelled_line) labels.add(px, py, p.label);
    marks += series.style == SeriesStyle::dots ? "/>" : point_title(chart, series, p) + "</circle>";
  }
  if (is_joined(series.style)) {
    svg +=
        "<path fill=\"none\" stroke-width=\"1.5\" stroke=\"" + colour + "\" d=\"" + path + "\"/>";
  }
  if (series.style != SeriesStyle::line) svg += marks + labels.text(chart, colour, i);
}

}  // namespace

std::string chart_svg(const Chart& chart) {
  std::string svg = formatted(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" width=\"%d\" height=\"%d\" "
      "role=\"img\" aria-label=\"%s\" font-family=\"sans-serif\" font-size=\"12\">",
      chart.width, chart.height, chart.width, chart.height,
      html_safe(chart.title.empty() ? chart.y_label : chart.title).c_str());
  svg += formatted("<text x=\"%.0f\" y=\"14\" font-size=\"13\" font-weight=\"600\">", kLeft) +
         html_safe(chart.title) + "</text>";
  const double top = kTop + add_legend(chart, svg);
  Axis x(chart.logarithmic), y(chart.logarithmic || chart.logarithmic_y);
  for (const ChartSeries& series : chart.series) {
    for (const ChartPoint& point : series.points) {
      if (!x.shows(point.x) || !y.shows(point.y)) continue;
      x.include(point.x);
      y.include(point.y);
    }
  }
  for (const ChartRule& rule : chart.rules) (rule.vertical ? x : y).include(rule.at);
  x.settle(0, kLeft, chart.width - kRight);
  y.settle(0.05, chart.height - kBottom, top);
  add_axes(chart, x, y, top, svg);
  for (const ChartRule& rule : chart.rules) add_rule(chart, rule, x, y, top, svg);
  for (std::size_t i = 0; i < chart.series.size(); ++i) add_series(chart, i, x, y, svg);
  for (const ChartRule& rule : chart.rules) add_rule_name(chart, rule, x, y, top, svg);
  return svg + "</svg>";
}

std::string charts_html(const std::vector<Chart>& charts) {
  std::string html = "<div class=\"charts\">\n";
  // A telephone shows charts of this width at three quarters of their size. The letters of wider
  // ones would be too small.
  constexpr int kShrinks = 470;  // pixels
  for (const Chart& chart : charts) {
    const bool scrolls = chart.width > kShrinks;
    if (scrolls) html += scroll_box("chart: " + html_safe(chart.title));
    html += chart_svg(chart) + (scrolls ? "</div>\n" : "\n");
  }
  return html + "</div>\n";
}

}  // namespace blindcorner
