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

/// Share of detections against the light, at some shares of false alarms.
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

/// "0.950 (0.899 to 0.980)".
std::string share_text(int part, std::size_t whole) {
  const int n = static_cast<int>(whole);
  const ShareInterval i = exact_interval(part, n);
  return formatted("%.3f (%.3f to %.3f)", n > 0 ? 1.0 * part / n : 0.0, i.low, i.high);
}

std::vector<TableRow> light_rows(const Scene& scene, const DetectionLevel& l) {
  return {{{{"scene", "", "", scene.name},
            {"photons", "photons", "%9g", *l.photons},
            {"with", "with", "%6d", l.with.size()},
            {"empty", "empty", "%6d", l.without.size()},
            {"failures", "failed", "%6d", l.failures},
            {"reported_with", "", "", l.reported_with},
            {"", "reported with (95 %)", "%22s", share_text(l.reported_with, l.with.size())},
            {"reported_empty", "", "", l.reported_without},
            {"", "in empty ones (95 %)", "%22s", share_text(l.reported_without, l.without.size())},
            {"area_presence", "area, presence", "%8.3f", area_below(l.by_presence)},
            {"area_false_alarm", "area, false alarm", "%8.3f", area_below(l.by_false_alarm)},
            {"detected_at_0.01", "at 1 %", "%8.3f", true_share_at(l.by_false_alarm, 0.01)},
            {"detected_at_0.05", "at 5 %", "%8.3f", true_share_at(l.by_false_alarm, 0.05)},
            {"detected_at_0.1", "at 10 %", "%8.3f", true_share_at(l.by_false_alarm, 0.1)}}}};
}

std::string detection_scene_html(const DetectionScene& scene) {
  std::vector<Chart> charts{light_chart(scene)};
  for (const DetectionLevel& level : scene.levels) charts.push_back(roc_chart(level));
  std::string html = "<h2>" + html_safe(scene.scene.name) + "</h2>\n" +
                     table_html(all_rows<DetectionLevel>({scene}, light_rows)) +
                     charts_html(charts) + "<p>Stated false-alarm probabilities:</p>\n";
  for (const DetectionLevel& level : scene.levels) {
    html += formatted("<p>%g photons:</p>\n", *level.photons) +
            table_html(claim_rows(scene.scene, level));
  }
  return html;
}

nlohmann::ordered_json detection_level_json(const Scene& scene, const DetectionLevel& level) {
  nlohmann::ordered_json json = level_json(level);
  json["reported_with"] = level.reported_with;
  json["reported_empty"] = level.reported_without;
  json["area_presence"] = area_below(level.by_presence);
  json["area_false_alarm"] = area_below(level.by_false_alarm);
  json["false_alarms"] = table_json(claim_rows(scene, level));
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
  std::string text =
      scene.scene.name + "\n" + table_text(all_rows<DetectionLevel>({scene}, light_rows));
  for (const DetectionLevel& l : scene.levels) {
    text += formatted("%g photons\n", *l.photons) + table_text(claim_rows(scene.scene, l));
  }
  return text;
}

std::string detection_csv(const DetectionReport& report) {
  return table_csv(all_rows(report.scenes, light_rows));
}

std::string false_alarms_csv(const DetectionReport& report) {
  return table_csv(all_rows(report.scenes, claim_rows));
}

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
