// SPDX-License-Identifier: Apache-2.0
#include "report/evaluation_page.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "report/chart.h"
#include "report/result_file.h"

namespace blindcorner {
namespace {

const char* const kColours[] = {"#1f77b4", "#d62728", "#2ca02c", "#9467bd",
                                "#ff7f0e", "#17becf", "#8c564b", "#e377c2"};

template <typename... Args>
std::string format(const char* pattern, Args... args) {
  char text[512];
  std::snprintf(text, sizeof text, pattern, args...);
  return text;
}

std::string figure_text(const Figure& figure) {
  return format("%.3f (%.3f to %.3f)", figure.value, figure.low, figure.high);
}

/// Share of estimates with at most a given error.
Chart error_chart(const std::vector<EvaluationRow>& rows) {
  Chart chart;
  chart.title = "errors";
  chart.x_label = "length of the error";
  chart.y_label = "share of estimates";
  chart.width = 460;
  chart.height = 320;
  std::size_t colour = 0;
  for (const EvaluationRow& row : rows) {
    std::vector<double> lengths;
    for (const EstimateError& e : row.errors) lengths.push_back(e.error.norm());
    std::sort(lengths.begin(), lengths.end());
    ChartLine line{row.name, kColours[colour++ % std::size(kColours)], {}, false};
    const std::size_t step = std::max<std::size_t>(1, lengths.size() / 200);
    for (std::size_t i = 0; i < lengths.size(); i += step) {
      line.points.emplace_back(lengths[i],
                               static_cast<double>(i + 1) / static_cast<double>(lengths.size()));
    }
    chart.lines.push_back(std::move(line));
  }
  return chart;
}

/// Share of coordinates within so many claimed standard deviations, against an honest Gaussian.
Chart coverage_chart(const std::vector<EvaluationRow>& rows) {
  Chart chart;
  chart.title = "coverage";
  chart.x_label = "claimed standard deviations";
  chart.y_label = "share of coordinates within";
  chart.width = 460;
  chart.height = 320;
  ChartLine honest{"honest", "#999999", {}, false};
  for (int i = 0; i <= 60; ++i)
    honest.points.emplace_back(0.05 * i, std::erf(0.05 * i / std::sqrt(2.0)));
  chart.lines.push_back(std::move(honest));
  std::size_t colour = 0;
  for (const EvaluationRow& row : rows) {
    std::vector<double> units;
    for (const EstimateError& e : row.errors) {
      for (Eigen::Index i = 0; i < e.error.size(); ++i) {
        units.push_back(std::abs(e.error[i]) / std::sqrt(e.covariance(i, i)));
      }
    }
    std::sort(units.begin(), units.end());
    ChartLine line{row.name, kColours[colour++ % std::size(kColours)], {}, false};
    for (int i = 0; i <= 60; ++i) {
      const auto within = std::upper_bound(units.begin(), units.end(), 0.05 * i) - units.begin();
      line.points.emplace_back(0.05 * i,
                               static_cast<double>(within) / static_cast<double>(units.size()));
    }
    chart.lines.push_back(std::move(line));
  }
  return chart;
}

}  // namespace

std::string evaluation_text(const std::vector<EvaluationRow>& rows) {
  std::string text;
  for (const EvaluationRow& row : rows) {
    text += format("%s: %d estimates of %d positions\n", row.name.c_str(), row.evaluation.estimates,
                   row.evaluation.groups);
    for (const Figure& figure : row.evaluation.figures) {
      text += format("  %-18s %s\n", figure.name.c_str(), figure_text(figure).c_str());
    }
  }
  return text;
}

std::string evaluation_page(const std::string& title, const std::vector<EvaluationRow>& rows,
                            const std::vector<std::string>& names) {
  std::string body =
      "<p>Lengths in m, angles in rad; bootstrap intervals (95 % unless stated "
      "otherwise) over positions. Honest: coverage 0.683 and 0.954, normalised error "
      "1.</p>\n<table><tr><th>&nbsp;";
  for (const EvaluationRow& row : rows) body += "<th>" + escaped(row.name);
  body += "</tr>\n<tr><td>estimates (positions)";
  for (const EvaluationRow& row : rows) {
    body += format("<td>%d (%d)", row.evaluation.estimates, row.evaluation.groups);
  }
  body += "</tr>\n";
  for (std::size_t f = 0; f < rows.front().evaluation.figures.size(); ++f) {
    body += "<tr><td>" + escaped(rows.front().evaluation.figures[f].name);
    for (const EvaluationRow& row : rows) {
      body += "<td>" + escaped(figure_text(row.evaluation.figures[f]));
    }
    body += "</tr>\n";
  }
  body += "</table>\n" + chart_svg(error_chart(rows)) + chart_svg(coverage_chart(rows)) + "<div>";
  // Estimate errors coordinate by coordinate of the first row.
  const EvaluationRow& first = rows.front();
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    Chart chart;
    chart.title = first.name + ": " + names[i];
    chart.x_label = "claimed standard deviation";
    chart.y_label = "error";
    chart.width = 300;
    ChartLine dots{"", kColours[0], {}, true};
    double most = 0;
    const std::size_t step = std::max<std::size_t>(1, first.errors.size() / 1500);
    for (std::size_t e = 0; e < first.errors.size(); e += step) {
      const double sigma = std::sqrt(first.errors[e].covariance(k, k));
      dots.points.emplace_back(sigma, first.errors[e].error[k]);
      most = std::max(most, sigma);
    }
    chart.lines = {dots,
                   {"2 sigma", "#d62728", {{0, 0}, {most, 2 * most}}, false},
                   {"", "#d62728", {{0, 0}, {most, -2 * most}}, false}};
    body += chart_svg(chart);
  }
  return simple_page(title, body + "</div>");
}

std::string evaluation_json(const std::vector<EvaluationRow>& rows) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const EvaluationRow& row : rows) {
    nlohmann::ordered_json figures;
    for (const Figure& f : row.evaluation.figures) {
      figures[f.name] = {{"value", f.value}, {"low", f.low}, {"high", f.high}};
    }
    list.push_back({{"name", row.name},
                    {"estimates", row.evaluation.estimates},
                    {"positions", row.evaluation.groups},
                    {"figures", std::move(figures)}});
  }
  nlohmann::ordered_json json;
  json["format"] = "blindcorner.evaluation/1";
  json["rows"] = std::move(list);
  return json.dump(1) + "\n";
}

}  // namespace blindcorner
