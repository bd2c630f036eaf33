// SPDX-License-Identifier: Apache-2.0
#include "report/chart_page.h"

#include <nlohmann/json.hpp>
#include <string_view>

namespace blindcorner {

namespace embedded {
std::string_view report_asset(std::string_view name);
}

namespace {

using nlohmann::json;

constexpr const char* kStyle =
    "body{font:14px/1.45 system-ui,sans-serif;margin:1.5em auto;max-width:1180px;padding:0 1em;"
    "color:#222;background:#fff}h1{font-size:1.35em}p{max-width:60em}"
    ".charts{display:flex;flex-wrap:wrap;gap:12px}svg{background:#fff}text{font:11px "
    "system-ui,sans-serif;fill:#222}.title{font-weight:600;font-size:12px}"
    ".axis path,.axis line{fill:none;stroke:#999;shape-rendering:crispEdges}"
    ".axis .minor{stroke:#eee}.rule{stroke:#888;stroke-dasharray:5 4}";

json to_json(const StudyChart& chart) {
  json series = json::array();
  for (const ChartSeries& s : chart.series) {
    json points = json::array();
    for (const ChartPoint& p : s.points) {
      if (p.x > 0 && p.y > 0) points.push_back({p.x, p.y, p.label});
    }
    series.push_back({{"name", s.name}, {"line", s.line}, {"points", std::move(points)}});
  }
  json rules = json::array();
  for (const ChartRule& r : chart.rules) {
    if (r.at > 0) rules.push_back({{"name", r.name}, {"at", r.at}, {"vertical", r.vertical}});
  }
  return {{"title", chart.title},
          {"x", chart.x_name},
          {"y", chart.y_name},
          {"series", std::move(series)},
          {"rules", std::move(rules)}};
}

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&') {
      out += "&amp;";
    } else if (c == '<') {
      out += "&lt;";
    } else {
      out += c;
    }
  }
  return out;
}

/// JSON inside a script element must not end it.
std::string script_safe(std::string text) {
  for (std::size_t at = 0; (at = text.find("</", at)) != std::string::npos; at += 3) {
    text.replace(at, 2, "<\\/");
  }
  return text;
}

}  // namespace

std::string chart_page(const std::string& title, const std::string& text,
                       const std::vector<StudyChart>& charts) {
  json list = json::array();
  for (const StudyChart& chart : charts) list.push_back(to_json(chart));
  std::string page = "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>";
  page += escaped(title) + "</title><style>" + kStyle + "</style></head><body><h1>";
  page +=
      escaped(title) + "</h1><p>" + escaped(text) + "</p><div class=\"charts\"></div>\n<script>";
  page += std::string(embedded::report_asset("d3.js")) + "</script>\n<script>const charts=";
  page += script_safe(list.dump()) + ";\n" + std::string(embedded::report_asset("chart.js"));
  return page + "</script></body></html>\n";
}

}  // namespace blindcorner
