// SPDX-License-Identifier: Apache-2.0
#include "report/evaluation_page.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "blindcorner/report/headline.h"
#include "blindcorner/report/result_file.h"
#include "forward/support/quantile.h"
#include "report/chart.h"
#include "report/colours.h"
#include "report/formatted.h"
#include "report/html.h"
#include "report/reading_units.h"

namespace blindcorner {
namespace {

/// A file by its folder and name: a whole path is longer than a chart is wide.
std::string short_name(const std::string& name) {
  const std::size_t last = name.rfind('/');
  if (last == std::string::npos || last == 0) return name;
  const std::size_t folder = name.rfind('/', last - 1);
  return folder == std::string::npos ? name : name.substr(folder + 1);
}

/// A figure and its interval. One position says nothing about how much the figure varies, so there
/// the interval is left out.
std::string figure_text(const Figure& figure, const Evaluation& evaluation) {
  const double unit = reading_unit(figure.name);
  const std::string value = formatted("%.3f", unit * figure.value);
  if (evaluation.groups < 2) return value;
  return value + formatted(" (%.3f to %.3f)", unit * figure.low, unit * figure.high);
}

/// What a figure's name does not say by itself.
std::string figure_note(const std::string& name) {
  if (name == "rmse_m") return "root mean square error of a coordinate";
  if (name.starts_with("rmse_")) return "root mean square error";
  if (name.ends_with("_distance_m")) return "distance in space";
  if (name.starts_with("median_") || name.starts_with("p90_")) return "absolute error";
  if (name == "coverage_1sigma") return "0.683 where claims are honest";
  if (name == "coverage_2sigma") return "0.954 where claims are honest";
  return name == "normalised_error" ? "1 where claims are honest" : "";
}

/// Distances from the truth. They are those of the heaviest modes where these are known, as on the
/// page of the fit.
std::vector<double> distances_of(const EvaluationRow& row, const std::vector<std::string>& names) {
  if (!row.mode_distances.empty()) return row.mode_distances;
  std::vector<double> distances;
  for (const EstimateError& e : row.errors) distances.push_back(distance_of(e.error, names));
  return distances;
}

/// "0.021 m", or the median and the 90th percentile of several.
std::string mode_distance_text(const EvaluationRow& row) {
  if (row.mode_distances.size() == 1) return formatted("%.4f m", row.mode_distances.front());
  return formatted("median %.4f m, 90th percentile %.4f m", quantile(row.mode_distances, 0.5),
                   quantile(row.mode_distances, 0.9));
}

/// About this many points of a curve, and dots of a chart, are drawn at most.
constexpr std::size_t kMaxCurvePoints = 200;
constexpr std::size_t kMaxDots = 1500;

/// The unit that an axis states after the name.
std::string unit_of(const std::string& unknown) {
  if (is_position(unknown)) return ", m";
  return unknown.ends_with("_rad") ? ", degrees" : "";
}

/// Share of estimates with at most a given error.
Chart error_chart(const std::vector<EvaluationRow>& rows, const std::vector<std::string>& names) {
  Chart chart{"errors", "distance from the true position, m", "share of estimates"};
  chart.width = 460;
  chart.height = 320;
  for (const EvaluationRow& row : rows) {
    std::vector<double> lengths = distances_of(row, names);
    std::sort(lengths.begin(), lengths.end());
    ChartSeries series{short_name(row.name), {{0, 0}}};
    const std::size_t count = lengths.size();
    const auto add = [&](std::size_t n) {
      series.points.push_back(
          {lengths[n - 1], static_cast<double>(n) / static_cast<double>(count)});
    };
    const std::size_t step = 1 + count / kMaxCurvePoints;
    for (std::size_t n = step; n < count; n += step) add(n);
    if (count > 0) add(count);
    chart.series.push_back(std::move(series));
  }
  return chart;
}

/// Share within each number of claimed standard deviations, from 0 to 3.
ChartSeries coverage_series(const std::string& name, const std::function<double(double)>& within) {
  ChartSeries series{name};
  for (int i = 0; i <= 60; ++i) series.points.push_back({0.05 * i, within(0.05 * i)});
  return series;
}

/// Share of coordinates within so many claimed standard deviations, against an honest Gaussian.
Chart coverage_chart(const std::vector<EvaluationRow>& rows) {
  Chart chart{"coverage", "claimed standard deviations", "share of coordinates within"};
  chart.width = 460;
  chart.height = 320;
  for (const EvaluationRow& row : rows) {
    std::vector<double> units;
    for (const EstimateError& e : row.errors) {
      for (Eigen::Index i = 0; i < e.error.size(); ++i) {
        units.push_back(std::abs(e.error[i]) / std::sqrt(e.covariance(i, i)));
      }
    }
    std::sort(units.begin(), units.end());
    chart.series.push_back(coverage_series(short_name(row.name), [&](double sigmas) {
      const auto within = std::upper_bound(units.begin(), units.end(), sigmas) - units.begin();
      return static_cast<double>(within) / static_cast<double>(units.size());
    }));
  }
  // This series comes last, so that a row has the same colour in both charts.
  ChartSeries honest =
      coverage_series("honest", [](double sigmas) { return std::erf(sigmas / std::sqrt(2.0)); });
  honest.colour = colour::kLine;
  chart.series.push_back(std::move(honest));
  return chart;
}

/// Errors of one unknown against their claimed standard deviations.
Chart unknown_chart(const EvaluationRow& row, const std::string& unknown, Eigen::Index k) {
  Chart chart{short_name(row.name) + ": " + reading_name(unknown),
              "claimed standard deviation" + unit_of(unknown), "error" + unit_of(unknown)};
  ChartSeries dots{"", {}, SeriesStyle::dots, colour::kFound};
  double most = 0;
  const std::size_t step = std::max<std::size_t>(1, row.errors.size() / kMaxDots);
  for (std::size_t e = 0; e < row.errors.size(); e += step) {
    const double unit = reading_unit(unknown);
    const double sigma = unit * std::sqrt(row.errors[e].covariance(k, k));
    dots.points.push_back({sigma, unit * row.errors[e].error[k]});
    most = std::max(most, sigma);
  }
  const std::string bound = colour::kInk;
  chart.series = {dots,
                  {"2 sigma", {{0, 0}, {most, 2 * most}}, SeriesStyle::line, bound},
                  {"", {{0, 0}, {most, -2 * most}}, SeriesStyle::line, bound}};
  return chart;
}

std::string evaluation_headline(const EvaluationRow& row, const std::vector<std::string>& names) {
  const std::vector<double> distances = distances_of(row, names);
  double squares = 0, count = 0;
  for (const EstimateError& e : row.errors) {
    for (Eigen::Index i = 0; i < e.error.size(); ++i, ++count) {
      squares += e.error[i] * e.error[i] / e.covariance(i, i);
    }
  }
  if (distances.empty() || std::ranges::none_of(names, is_position)) return {};
  // With fewer estimates, neither shares nor the claimed errors can be judged.
  constexpr std::size_t kFew = 10;
  if (distances.size() < kFew) {
    return (distances.size() == 1 ? "The position is "
                                  : "All " + std::to_string(distances.size()) + " positions are ") +
           "within " + said_length(std::ranges::max(distances)) +
           " of the truth; too few to judge the claimed errors.";
  }
  // Errors this many times larger or smaller than claimed are called out.
  constexpr double kHalf = 1.5;
  const double ratio = std::sqrt(squares / count);
  const char* honest = ratio > kHalf       ? "the claimed errors are too small"
                       : ratio < 1 / kHalf ? "the claimed errors are larger than they need be"
                                           : "the claimed errors are about right";
  return "Half of the positions are within " + said_length(quantile(distances, 0.5)) +
         " of the truth, nine of ten within " + said_length(quantile(distances, 0.9)) + "; " +
         honest + ".";
}

}  // namespace

std::string evaluation_text(const std::vector<EvaluationRow>& rows) {
  std::string text;
  for (const EvaluationRow& row : rows) {
    text += formatted("%s: %d estimates of %d positions\n", row.name.c_str(),
                      row.evaluation.estimates, row.evaluation.groups);
    if (!row.mode_distances.empty()) {
      text += "  heaviest mode to truth: " + mode_distance_text(row) + "\n";
    }
    if (!row.estimator.empty()) text += "  " + row.estimator + ":\n";
    for (const Figure& figure : row.evaluation.figures) {
      text +=
          formatted("  %-20s %-24s %s\n", reading_name(figure.name).c_str(),
                    figure_text(figure, row.evaluation).c_str(), figure_note(figure.name).c_str());
    }
  }
  return text;
}

std::string evaluation_page(const std::string& title, const std::vector<EvaluationRow>& rows,
                            const std::vector<std::string>& names) {
  std::string body =
      "<p>Lengths in m, angles in degrees; bootstrap intervals (95 %) over positions, where there "
      "are several. Honest: coverage 0.683 and 0.954, normalised error 1.</p>\n"
      "<table><tr><th>figure";
  for (const EvaluationRow& row : rows) {
    body += "<th style=\"white-space:normal;overflow-wrap:anywhere;min-width:8em\">" +
            html_safe(short_name(row.name));
  }
  body += "</tr>\n<tr><td>estimates (positions)";
  for (const EvaluationRow& row : rows) {
    body += formatted("<td>%d (%d)", row.evaluation.estimates, row.evaluation.groups);
  }
  body += "</tr>\n";
  if (std::ranges::none_of(rows, [](const auto& row) { return row.mode_distances.empty(); })) {
    body += "<tr><td>heaviest mode to truth";
    for (const EvaluationRow& row : rows) {
      body += "<td style=\"white-space:normal\">" + mode_distance_text(row);
    }
    body += "</tr>\n";
  }
  if (!rows.front().estimator.empty()) {
    body += "<tr><td style=\"white-space:normal\">" + html_safe(rows.front().estimator) +
            ":<td></tr>\n";
  }
  for (std::size_t f = 0; f < rows.front().evaluation.figures.size(); ++f) {
    const std::string& name = rows.front().evaluation.figures[f].name;
    body += "<tr><td>" + html_safe(reading_name(name)) + "<br><small>" +
            html_safe(figure_note(name)) + "</small>";
    for (const EvaluationRow& row : rows) {
      body += "<td>" + html_safe(figure_text(row.evaluation.figures[f], row.evaluation));
    }
    body += "</tr>\n";
  }
  body += "</table>\n" + charts_html({error_chart(rows, names), coverage_chart(rows)});
  std::vector<Chart> unknowns;
  for (std::size_t i = 0; i < names.size(); ++i) {
    unknowns.push_back(unknown_chart(rows.front(), names[i], static_cast<Eigen::Index>(i)));
  }
  return plain_page(title, evaluation_headline(rows.front(), names), body + charts_html(unknowns));
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
    if (row.mode_distances.empty()) continue;
    list.back()["mode_distance_m"] = {{"median", quantile(row.mode_distances, 0.5)},
                                      {"p90", quantile(row.mode_distances, 0.9)}};
  }
  nlohmann::ordered_json json;
  json["format"] = "blindcorner.evaluation/2";
  json["rows"] = std::move(list);
  return json.dump(1) + "\n";
}

}  // namespace blindcorner
