// SPDX-License-Identifier: Apache-2.0
#include "report/detection_page.h"

#include <algorithm>
#include <cmath>

#include "report/chart.h"
#include "report/claim_table.h"
#include "report/colours.h"
#include "report/formatted.h"
#include "report/html.h"

namespace blindcorner {
namespace {

/// Shares of false alarms at which the share of detections is told.
constexpr double kToldShares[] = {0.01, 0.05, 0.1};

struct Statistic {
  const char* name;
  const char* colour;
  std::vector<RocPoint> DetectionLevel::*curve;
};
const Statistic kStatistics[] = {
    {"presence probability", colour::kModel, &DetectionLevel::by_presence},
    {"false-alarm probability", colour::kFound, &DetectionLevel::by_false_alarm},
};

Chart roc_chart(const DetectionLevel& level) {
  Chart chart{formatted("%g photons", *level.photons), "share of empty captures",
              "share of captures with an object"};
  chart.width = 370;
  chart.height = 330;
  for (const Statistic& statistic : kStatistics) {
    ChartSeries series{statistic.name, {}, SeriesStyle::line, statistic.colour};
    for (const RocPoint& p : level.*statistic.curve) {
      series.points.push_back({p.false_share, p.true_share});
    }
    chart.series.push_back(std::move(series));
  }
  chart.series.push_back({"chance", {{0, 0}, {1, 1}}, SeriesStyle::line, colour::kLine});
  return chart;
}

/// Detections over the light at some shares of false alarms.
Chart light_chart(const DetectionScene& scene) {
  Chart chart{"detections by light", "log10 of the photons of the object",
              "share of captures with an object"};
  chart.width = 560;
  chart.height = 330;
  for (const double told : kToldShares) {
    ChartSeries series{
        formatted("false alarms in %g %%", 100 * told), {}, SeriesStyle::marked_line, {}};
    for (const DetectionLevel& level : scene.levels) {
      series.points.push_back({std::log10(*level.photons),
                               true_share_at(level.by_false_alarm, told),
                               formatted("%g photons", *level.photons)});
    }
    chart.series.push_back(std::move(series));
  }
  return chart;
}

std::string share_html(int part, std::size_t whole) {
  const int n = static_cast<int>(whole);
  const ShareInterval i = exact_interval(part, n);
  return formatted("%.3f (%.3f to %.3f)", n > 0 ? 1.0 * part / n : 0.0, i.low, i.high);
}

std::string level_table(const DetectionScene& scene) {
  std::string html =
      "<table><tr><th>photons<th>with an "
      "object<th>empty<th>reported "
      "with an object (95 %)<th>reported in empty ones (95 %)<th>area, presence<th>area, false "
      "alarm";
  for (const double told : kToldShares) html += formatted("<th>detected at %g %%", 100 * told);
  html += "<th>failed</tr>\n";
  for (const DetectionLevel& l : scene.levels) {
    html += formatted("<tr><td>%g<td>%d<td>%d<td>", *l.photons, static_cast<int>(l.with.size()),
                      static_cast<int>(l.without.size())) +
            share_html(l.reported_with, l.with.size()) + "<td>" +
            share_html(l.reported_without, l.without.size()) +
            formatted("<td>%.3f<td>%.3f", area_below(l.by_presence), area_below(l.by_false_alarm));
    for (const double told : kToldShares) {
      html += formatted("<td>%.3f", true_share_at(l.by_false_alarm, told));
    }
    html += formatted("<td>%d</tr>\n", l.failures);
  }
  return html + "</table>\n";
}

std::string detection_scene_html(const DetectionScene& scene) {
  std::vector<Chart> charts{light_chart(scene)};
  for (const DetectionLevel& level : scene.levels) charts.push_back(roc_chart(level));
  std::string html = "<h2>" + html_safe(scene.scene.name) + "</h2>\n" + level_table(scene) +
                     charts_html(charts) + "<p>Stated false-alarm probabilities:</p>\n";
  for (const DetectionLevel& level : scene.levels) {
    html += formatted("<p>%g photons:</p>\n", *level.photons) + claim_table_html(level.claims);
  }
  return html;
}

nlohmann::ordered_json detection_level_json(const DetectionLevel& level) {
  nlohmann::ordered_json json = level_json(level);
  json["reported_with"] = level.reported_with;
  json["reported_empty"] = level.reported_without;
  json["area_presence"] = area_below(level.by_presence);
  json["area_false_alarm"] = area_below(level.by_false_alarm);
  json["false_alarms"] = claims_json(level.claims);
  return json;
}

}  // namespace

std::string detection_headline(const DetectionReport& report) {
  const ClaimCount count = count_claims(report.scenes);
  return formatted(
      "%d of %d stated false-alarm probabilities hold on empty captures that calibrated nothing; "
      "all would, with 95 %%, if they were right.",
      count.holding, count.claims);
}

std::string detection_text(const DetectionScene& scene) {
  std::string text = formatted("%s\n%9s %8s %8s %10s %10s %8s %8s %8s %8s %8s\n",
                               scene.scene.name.c_str(), "photons", "with", "empty", "reported",
                               "in empty", "area p", "area f", "at 1 %", "at 5 %", "at 10 %");
  for (const DetectionLevel& l : scene.levels) {
    text += formatted("%9g %8d %8d %10.3f %10.3f %8.3f %8.3f", *l.photons,
                      static_cast<int>(l.with.size()), static_cast<int>(l.without.size()),
                      l.reported_with / static_cast<double>(l.with.size()),
                      l.reported_without / static_cast<double>(l.without.size()),
                      area_below(l.by_presence), area_below(l.by_false_alarm));
    for (const double told : kToldShares) {
      text += formatted(" %8.3f", true_share_at(l.by_false_alarm, told));
    }
    text += "\n";
  }
  for (const DetectionLevel& l : scene.levels) {
    text += formatted("%g photons\n", *l.photons) + claim_table_text(l.claims);
  }
  return text;
}

std::string detection_csv(const DetectionReport& report) {
  std::string csv =
      "scene,photons,with,empty,failures,reported_with,reported_empty,area_presence,"
      "area_false_alarm,detected_at_0.01,detected_at_0.05,detected_at_0.1\n";
  for (const DetectionScene& scene : report.scenes) {
    for (const DetectionLevel& l : scene.levels) {
      csv += "\"" + scene.scene.name + "\"" +
             formatted(",%g,%d,%d,%d,%d,%d,%.5g,%.5g", *l.photons, static_cast<int>(l.with.size()),
                       static_cast<int>(l.without.size()), l.failures, l.reported_with,
                       l.reported_without, area_below(l.by_presence), area_below(l.by_false_alarm));
      for (const double told : kToldShares) {
        csv += formatted(",%.5g", true_share_at(l.by_false_alarm, told));
      }
      csv += "\n";
    }
  }
  return csv;
}

std::string false_alarms_csv(const DetectionReport& report) { return claims_csv(report.scenes); }

std::string roc_csv(const DetectionReport& report) {
  std::string csv = "scene,photons,statistic,false_share,true_share\n";
  for (const DetectionScene& scene : report.scenes) {
    for (const DetectionLevel& l : scene.levels) {
      for (const Statistic& statistic : kStatistics) {
        for (const RocPoint& p : l.*statistic.curve) {
          csv += "\"" + scene.scene.name + "\"" +
                 formatted(",%g,\"%s\",%.6g,%.6g\n", *l.photons, statistic.name, p.false_share,
                           p.true_share);
        }
      }
    }
  }
  return csv;
}

nlohmann::ordered_json detection_json(const DetectionReport& report) {
  nlohmann::ordered_json json =
      study_json("blindcorner.detection/1", report.options, detection_headline(report));
  json["empty_captures"] = report.options.empty_captures;
  json["scenes"] = scenes_json(report.scenes, detection_level_json);
  return json;
}

std::string detection_page(const DetectionReport& report) {
  const DetectionOptions& options = report.options;
  std::string body =
      formatted(
          "<p>%d captures with an object and %d empty ones at each level of light, seed %llu. "
          "Poses "
          "and brightness come from the scene's priors; an exposure is the same for all captures "
          "of "
          "a level: objects of the stated brightness send so many photons on average over the "
          "search region, over an equal background.</p>\n",
          options.captures, options.empty_captures, static_cast<unsigned long long>(options.seed)) +
      "<p>A curve goes through all thresholds of a statistic: to its right are the empty captures "
      "that are taken for an object, upwards the objects that are found. <i>Reported</i> means "
      "that the fit is not flagged nothing_detected. A stated probability holds where the share "
      "of empty captures below it lies within what is allowed: " +
      kJudgedTogether + "</p>\n";
  for (const DetectionScene& scene : report.scenes) body += detection_scene_html(scene);
  return plain_page("Detections and false alarms", detection_headline(report), body);
}

}  // namespace blindcorner
