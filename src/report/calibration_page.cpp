// SPDX-License-Identifier: Apache-2.0
#include "report/calibration_page.h"

#include <algorithm>
#include <limits>

#include "report/chart.h"
#include "report/colours.h"
#include "report/formatted.h"
#include "report/html.h"

namespace blindcorner {
namespace {

std::string assignment_text(const SpotAssignment& assignment) {
  std::string text;
  for (const int spot : assignment.spot) text += (text.empty() ? "" : " ") + std::to_string(spot);
  return text;
}

/// "value +- error". The error of a logarithmic parameter is in per cent of the value.
std::string value_text(const CalibratedParameter& p) {
  if (!p.determined) return formatted("%.6g", p.value);
  if (p.logarithmic) return formatted("%.6g +- %.2g %%", p.value, 100 * p.standard_error);
  return formatted("%.6g +- %.2g", p.value, p.standard_error);
}

std::string wrap_text(const ZoneWrap& wrap) {
  const auto after = [](int bins) {
    return bins > 0 ? formatted("wraps after %d bins", bins) : std::string("does not wrap");
  };
  std::string text = after(wrap.found);
  if (wrap.found != wrap.stated) text += ", stated: " + after(wrap.stated);
  return text + ", next best by " + formatted("%.0f: ", wrap.margin) + after(wrap.next);
}

std::string noise_text(const Scene& scene) {
  const auto line = scene.sensor.noise.stated_line();
  if (!line) return formatted("variance = %.4g per count", scene.sensor.dispersion);
  if (!scene.sensor.zones_have_noise_floors()) {
    return formatted("variance = %.4g + %.4g per count", line->floor, line->per_count);
  }
  std::string floors;
  for (const Zone& zone : scene.sensor.zones) {
    if (zone.variance_floor > 0) floors += formatted(" %.4g", zone.variance_floor);
  }
  return formatted("variance =%s (zone by zone) + %.4g per count", floors.c_str(), line->per_count);
}

std::string summary_line(const Calibration& c) {
  return formatted("%d captures used, %zu left out; deviance %.0f before, %.0f after, %.0f bins",
                   c.used, c.left_out.size(), c.deviance_before, c.deviance_after,
                   c.expected_deviance);
}

/// A series over time, ns. Values below `least` are left out.
ChartSeries series_of(const char* name, const char* colour, const std::vector<double>& values,
                      double bin_width, SeriesStyle style, double least) {
  ChartSeries series{name, {}, style, colour};
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (values[k] < least) continue;
    series.points.push_back({1e9 * bin_width * static_cast<double>(k), values[k]});
  }
  return series;
}

Chart view_chart(const CalibrationView& view, double bin_width, bool background) {
  Chart chart{"zone " + std::to_string(view.zone), "time, ns; the object's light moved together",
              background ? "mean counts, without background" : "mean counts"};
  // The direct return is a thousand times as tall as the light by way of an object.
  chart.logarithmic_y = true;
  // Model values far below all measured ones would take up most of that axis.
  double least = std::numeric_limits<double>::infinity();
  for (const double value : view.measured) {
    if (value > 0) least = std::min(least, 0.1 * value);
  }
  chart.series = {
      series_of("before", colour::kLine, view.before, bin_width, SeriesStyle::line, least),
      series_of("after", colour::kModel, view.after, bin_width, SeriesStyle::line, least),
      series_of("measured", colour::kMeasured, view.measured, bin_width, SeriesStyle::dots, least)};
  return chart;
}

/// Deviance beyond this many times its expectation: the model does not explain the captures.
constexpr double kPoorFit = 2;

/// Whether gains were looked for and none was determined.
bool gains_unknown(const Calibration& c) {
  bool any = false;
  for (const CalibratedParameter& p : c.parameters) {
    if (!p.name.starts_with("gain")) continue;
    if (p.determined) return false;
    any = true;
  }
  return any;
}

constexpr const char* kGainsUnknown =
    "These captures say nothing about the gains, which stay as the scene says: where the scale of "
    "the direct return is unknown too (linear.direct.mode \"per_zone\"), it takes their place.";

std::string calibration_headline(const Calibration& c) {
  const auto determined = std::ranges::count_if(c.parameters, &CalibratedParameter::determined);
  std::string text = formatted(
      "%d capture%s told %td of %zu properties of the instrument; the others stay as the scene "
      "says. ",
      c.used, c.used == 1 ? "" : "s", determined, c.parameters.size());
  const double expected = std::max(c.expected_deviance, 1.0);
  if (c.deviance_after > kPoorFit * c.expected_deviance) {
    return text + formatted(
                      "The model still misses the captures by %.2g times their noise (before: %.2g "
                      "times). The scene does not explain them well: look at the pictures.",
                      c.deviance_after / expected, c.deviance_before / expected);
  }
  text += "The model now explains the captures to within their noise.";
  return text;
}

}  // namespace

std::string calibration_text(const Calibration& calibration) {
  std::string text = summary_line(calibration) + "\n";
  for (const CalibratedParameter& p : calibration.parameters) {
    text += formatted("  %-32s %-26s prior %.6g%s\n", p.name.c_str(), value_text(p).c_str(),
                      p.prior, p.determined ? "" : "  not determined, kept");
  }
  text += "  noise: " + noise_text(calibration.scene) +
          formatted(", of this a factor %.2f to make fits honest\n", calibration.variance_scale);
  const auto& ambient = calibration.scene.linear.ambient_prior;
  for (std::size_t z = 0; z < ambient.size(); ++z) {
    text += formatted("  ambient[%zu]: %.4g +- %.2g counts per bin\n", z, ambient[z].mean,
                      ambient[z].sigma);
  }
  text +=
      formatted("  brightness of the object varies by %.1f %%\n", 100 * calibration.brightness_log);
  if (!calibration.assignments.empty()) {
    text += "  spots (place by place), deviance:\n";
    for (std::size_t i = 0; i < std::min<std::size_t>(3, calibration.assignments.size()); ++i) {
      text += formatted("    %s: %.0f\n", assignment_text(calibration.assignments[i]).c_str(),
                        calibration.assignments[i].deviance);
    }
  }
  for (const ZoneWrap& wrap : calibration.wraps) {
    text += formatted("  zone %d ", wrap.zone) + wrap_text(wrap) + "\n";
  }
  for (const BackgroundBin& b : calibration.background) {
    text += formatted("  background[zone %d, bin %d]: %.4g +- %.2g counts\n", b.zone, b.bin,
                      b.counts, b.standard_error);
  }
  for (const LeftOutCapture& out : calibration.left_out) {
    text += formatted("  capture %d left out: ", out.index) + out.reason + "\n";
  }
  if (gains_unknown(calibration)) text += std::string("  ") + kGainsUnknown + "\n";
  for (const std::string& note : calibration.notes) text += "  " + note + "\n";
  return text;
}

std::string calibration_page(const Scene& before, const Calibration& calibration) {
  std::vector<Chart> charts;
  for (const CalibrationView& view : calibration.views) {
    charts.push_back(
        view_chart(view, before.sensor.bin_width, calibration.scene.sensor.has_background()));
  }
  std::string body = "<p>" + html_safe(summary_line(calibration)) + "</p>\n" + charts_html(charts);
  body += "<table><tr><th>parameter<th>value<th>prior<th>its sigma</tr>\n";
  for (const CalibratedParameter& p : calibration.parameters) {
    body += std::string("<tr") + (p.determined ? "" : " class=\"open\"") + "><td>" +
            html_safe(p.name) + "<td>" + html_safe(value_text(p)) +
            (p.determined ? "" : " (not determined, kept)") +
            formatted("<td>%.6g<td>%.3g</tr>\n", p.prior, p.prior_sigma);
  }
  body += "</table>\n";
  if (gains_unknown(calibration)) body += "<p>" + html_safe(kGainsUnknown) + "</p>\n";
  body += "<p>Noise: " + html_safe(noise_text(calibration.scene)) +
          formatted(
              ", of this a factor %.2f so that fits of these captures are honest. The object's "
              "brightness varies by %.1f %%.</p>\n",
              calibration.variance_scale, 100 * calibration.brightness_log);
  if (!calibration.assignments.empty()) {
    body += "<table><tr><th>spot in each place<th>deviance</tr>\n";
    for (const SpotAssignment& a : calibration.assignments) {
      body += "<tr><td>" + assignment_text(a) + formatted("<td>%.0f</tr>\n", a.deviance);
    }
    body += "</table>\n";
  }
  if (!calibration.wraps.empty()) {
    body +=
        "<table><tr><th>zone<th>time axis (and by which deviance the next best is worse)</tr>\n";
    for (const ZoneWrap& wrap : calibration.wraps) {
      body += formatted("<tr><td>%d<td>", wrap.zone) + wrap_text(wrap) + "</tr>\n";
    }
    body += "</table>\n";
  }
  if (!calibration.background.empty()) {
    body +=
        "<p>Static background besides the ambient light; bins that are not listed hold none that "
        "the data show.</p>\n<table><tr><th>zone<th>bin<th>counts</tr>\n";
    for (const BackgroundBin& b : calibration.background) {
      body += formatted("<tr><td>%d<td>%d<td>%.4g +- %.2g</tr>\n", b.zone, b.bin, b.counts,
                        b.standard_error);
    }
    body += "</table>\n";
  }
  for (const LeftOutCapture& out : calibration.left_out) {
    body += formatted("<p>Capture %d left out: ", out.index) + html_safe(out.reason) + "</p>\n";
  }
  for (const std::string& note : calibration.notes) body += "<p>" + html_safe(note) + "</p>\n";
  return plain_page("Calibration of " + before.name, calibration_headline(calibration), body);
}

}  // namespace blindcorner
