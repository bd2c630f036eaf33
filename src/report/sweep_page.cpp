// SPDX-License-Identifier: Apache-2.0
#include "report/sweep_page.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "blindcorner/simulation/credible_level.h"
#include "blindcorner/simulation/pareto_front.h"
#include "report/chart.h"
#include "report/colours.h"
#include "report/formatted.h"
#include "report/html.h"
#include "report/json_values.h"
#include "report/table.h"

namespace blindcorner {
namespace {

const char* const kSettingColour = colour::kModel;
const char* const kOtherColour = "var(--object,#e69f00)";
const char* const kDefaultColour = colour::kFound;
const char* const kFrontColour = colour::kTruth;

/// Methods that take a smaller share of the default's time than this are not drawn: they do not
/// look at the capture.
constexpr double kMinShownTime = 1e-2;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

double share_of(int part, int whole) {
  return whole > 0 ? static_cast<double>(part) / whole : std::nan("");
}

ShareInterval held_interval(const SweepFigures& f) { return wilson_interval(f.held, f.claims); }

/// A row for each method at each level of light.
std::vector<TableRow> figure_rows(const SweepScene& scene, const std::string& wrong) {
  std::vector<TableRow> rows;
  for (const SweepLevel& level : scene.levels) {
    for (std::size_t m = 0; m < scene.methods.size(); ++m) {
      const SweepCell& cell = level.cells[m];
      const SweepFigures& f = level.figures[m];
      const bool claims = f.claims > 0;
      rows.push_back({{{"scene", "", "", scene.name},
                       {"wrong", "", "", wrong},
                       {"photons", "photons", "%9g", level.photons},
                       {"bound_median_m", "", "", level.bound_median},
                       {"bound_p90_m", "", "", level.bound_p90},
                       {"bound_rms_m", "", "", level.bound_rms},
                       {"method", "method", "%-28s", scene.methods[m].name},
                       {"varies", "", "", scene.methods[m].varies},
                       {"answers", "", "", f.answers},
                       {"failures", "", "", f.failures},
                       {"median_m", "median m", "%9.4f", f.median},
                       {"p90_m", "90 % m", "%9.4f", f.p90},
                       {"rms_m", "rms m", "%9.4f", f.rms},
                       {"right_mode", "right", "%7.3f", share_of(f.right, f.claims)},
                       {"right_mode_rms_m", "in right", "%9.3f", f.right_rms},
                       {"coverage_95", "in 95%", "%7.3f", share_of(f.held, f.claims)},
                       {"coverage_95_low", "", "", claims ? held_interval(f).low : kNone},
                       {"coverage_95_high", "", "", claims ? held_interval(f).high : kNone},
                       {"efficiency", "efficiency", "%10.3f", f.efficiency},
                       {"efficiency_low", "", "", f.efficiency_low},
                       {"efficiency_high", "", "", f.efficiency_high},
                       {"efficiency_captures", "", "", f.efficiency_captures},
                       {"first_cpu_ms", "first ms", "%9.3g", 1e3 * cell.first_cpu},
                       {"first_wall_ms", "", "", 1e3 * cell.first_wall},
                       {"following_cpu_ms", "next ms", "%9.3g", 1e3 * f.following_cpu},
                       {"following_wall_ms", "", "", 1e3 * f.following_wall}}});
    }
  }
  return rows;
}

/// The time (ms) and the error (m) of a method that a picture shows.
using TimeOf = double (*)(const SweepCell&, const SweepFigures&);
using ErrorOf = double (*)(const SweepFigures&);

double following_ms(const SweepCell&, const SweepFigures& f) { return 1e3 * f.following_cpu; }
double first_ms(const SweepCell& c, const SweepFigures&) { return 1e3 * c.first_cpu; }
double median_of(const SweepFigures& f) { return f.median; }
double p90_of(const SweepFigures& f) { return f.p90; }
double rms_of_right(const SweepFigures& f) { return f.right_rms; }

/// Adds the front, the settings, the other methods and the default to a chart, a series each. The
/// first point is that of the default.
void add_front(const std::vector<ChartPoint>& points, const std::vector<bool>& solver,
               bool label_front, Chart& chart) {
  ChartSeries settings{"settings of the solver", {}, SeriesStyle::marks, kSettingColour};
  ChartSeries others{"other methods", {}, SeriesStyle::marks, kOtherColour};
  ChartSeries chosen{"default", {}, SeriesStyle::circles, kDefaultColour};
  ChartSeries front{
      "front", {}, label_front ? SeriesStyle::labelled_line : SeriesStyle::line, kFrontColour};
  std::vector<CostAndError> places;
  for (std::size_t i = 0; i < points.size(); ++i) {
    (solver[i] ? settings : others).points.push_back(points[i]);
    places.push_back({points[i].x, points[i].y});
  }
  if (!points.empty()) chosen.points.push_back(points.front());
  for (const std::size_t i : pareto_front(places)) front.points.push_back(points[i]);
  chart.series = {front, settings, others, chosen};
}

Chart level_picture(const SweepScene& scene, const SweepLevel& level, TimeOf time, ErrorOf error,
                    double bound, const char* what) {
  Chart chart{formatted("%g photons", level.photons), "ms of processor time", what};
  chart.logarithmic = true;
  chart.width = 370;
  chart.height = 300;
  std::vector<ChartPoint> points;
  std::vector<bool> solver;
  const double least = kMinShownTime * time(level.cells.front(), level.figures.front());
  for (std::size_t m = 0; m < scene.methods.size(); ++m) {
    if (time(level.cells[m], level.figures[m]) < least) continue;
    points.push_back(
        {time(level.cells[m], level.figures[m]), error(level.figures[m]), scene.methods[m].name});
    solver.push_back(scene.methods[m].solver);
  }
  add_front(points, solver, false, chart);
  chart.rules = {{"bound", bound, false}};
  return chart;
}

std::string pictures(const SweepScene& scene, TimeOf time, ErrorOf error, double SweepLevel::*bound,
                     const char* what) {
  std::vector<Chart> charts;
  for (const SweepLevel& level : scene.levels) {
    charts.push_back(level_picture(scene, level, time, error, level.*bound, what));
  }
  return charts_html(charts);
}

/// Errors of a few methods over the light.
std::string by_light(const SweepScene& scene) {
  Chart error{"error and light", "photons of the object", "median error of the position, m"};
  Chart fine{"efficiency of the default", "photons of the object", "error over bound, right mode"};
  error.logarithmic = fine.logarithmic = true;
  error.width = fine.width = 560;
  error.height = fine.height = 320;
  ChartSeries bound{"bound", {}, SeriesStyle::line, colour::kLine};
  ChartSeries efficiency{"error over bound (bound below a quarter of the pulse)",
                         {},
                         SeriesStyle::marked_line,
                         kDefaultColour};
  for (const SweepLevel& level : scene.levels) {
    bound.points.push_back({level.photons, level.bound_median});
    const SweepFigures& f = level.figures.front();
    efficiency.points.push_back({level.photons, f.efficiency,
                                 formatted("%d captures, %.2f to %.2f", f.efficiency_captures,
                                           f.efficiency_low, f.efficiency_high)});
  }
  error.series.push_back(bound);
  for (std::size_t m = 0; m < scene.methods.size(); ++m) {
    if (m > 0 && scene.methods[m].solver) continue;
    ChartSeries series{scene.methods[m].name, {}, SeriesStyle::marked_line, {}};
    for (const SweepLevel& level : scene.levels) {
      series.points.push_back({level.photons, level.figures[m].median});
    }
    error.series.push_back(std::move(series));
  }
  fine.series = {efficiency};
  fine.rules = {{"aim: 1.1", 1.1, false}, {"bound", 1.0, false}};
  return charts_html({error, fine});
}

Chart ratio_chart(const SweepVerdict& verdict) {
  Chart chart{"all scenes and levels of light together", "processor time, default = 1",
              "error, default = 1 (geometric means)"};
  chart.logarithmic = true;
  chart.width = 760;
  chart.height = 440;
  std::vector<ChartPoint> points;
  std::vector<bool> solver;
  for (const SweepRatio& r : verdict.ratios) {
    if (r.time < kMinShownTime) continue;
    points.push_back({r.time, r.error, r.name});
    solver.push_back(r.solver);
  }
  add_front(points, solver, true, chart);
  return chart;
}

/// What the intervals say of a method compared with the default.
std::string beside_default(const SweepRatio& r) {
  const std::string time = r.cheaper() ? "cheaper" : r.time_low > 1 ? "dearer" : "as dear";
  const std::string error = r.better()  ? "smaller error"
                            : r.worse() ? "larger error"
                                        : "error not told apart";
  return time + ", " + error + (r.holds_less() ? ", holds the truth less often" : "");
}

/// The ends of an interval may be so large that only their order of magnitude counts.
std::string ratio_text(double value) {
  constexpr double kLarge = 1000;
  if (!std::isfinite(value)) return "-";
  return formatted(value < kLarge ? "%.3f" : "%.1e", value);
}

std::string with_interval(double value, double low, double high) {
  return ratio_text(value) + " (" + ratio_text(low) + " to " + ratio_text(high) + ")";
}

/// A row for each method compared with the default, which is the first. Each 95 % holds for the
/// intervals of all rows together.
std::vector<TableRow> ratio_rows(const SweepVerdict& verdict) {
  std::vector<TableRow> rows;
  for (const SweepRatio& r : verdict.ratios) {
    rows.push_back(
        {{{"method", "method", "%s", r.name},
          {"varies", "varies", "%s", r.varies},
          {"", "time, following (95 %)", "%s", with_interval(r.time, r.time_low, r.time_high)},
          {"time", "", "", r.time},
          {"time_low", "", "", r.time_low},
          {"time_high", "", "", r.time_high},
          {"first_time", "time, first", "%.3f", r.first_time},
          {"wall", "wall, following", "%.3f", r.wall},
          {"", "error (95 %)", "%s", with_interval(r.error, r.error_low, r.error_high)},
          {"error", "", "", r.error},
          {"error_low", "", "", r.error_low},
          {"error_high", "", "", r.error_high},
          {"coverage_95", "coverage of 95 %", "%.3f", r.coverage},
          {"right_mode", "right mode", "%.3f", r.right},
          {"held_alone", "", "", r.held_alone},
          {"default_alone", "", "", r.default_alone},
          {"captures", "captures", "%d", r.captures},
          {"", "beside the default", "%s", rows.empty() ? "" : beside_default(r)}}});
  }
  return rows;
}

std::string scene_html(const SweepScene& scene) {
  return "<h2>" + html_safe(scene.name) + "</h2>\n" +
         formatted("<p>The pulse is %.3f m long (half maximum, as path).</p>\n", scene.pulse) +
         by_light(scene) + "<p>Median error against the time of a following capture:</p>\n" +
         pictures(scene, following_ms, median_of, &SweepLevel::bound_median, "median error, m") +
         "<details><summary>Error that nine of ten captures stay below, against the time of a "
         "following capture</summary>\n" +
         pictures(scene, following_ms, p90_of, &SweepLevel::bound_p90, "90 % error, m") +
         "</details>\n<details><summary>RMS error in the right mode, against the time of a "
         "following capture</summary>\n" +
         pictures(scene, following_ms, rms_of_right, &SweepLevel::bound_rms, "RMS, right mode, m") +
         "</details>\n<details open><summary>Median error against the time of a first capture, all "
         "that the method prepares included</summary>\n" +
         pictures(scene, first_ms, median_of, &SweepLevel::bound_median, "median error, m") +
         "</details>\n<details><summary>All figures</summary>\n" +
         table_html(figure_rows(scene, "")) + "</details>\n";
}

}  // namespace

std::string sweep_text(const SweepScene& scene) {
  std::string text = scene.name + "\n" + table_text(figure_rows(scene, ""));
  for (const SweepLevel& level : scene.levels) {
    text += formatted("Cramer-Rao bound at %g photons: median %.4f m, 90 %% %.4f m, rms %.4f m\n",
                      level.photons, level.bound_median, level.bound_p90, level.bound_rms);
  }
  return text;
}

std::string sweep_csv(const SweepReport& report) {
  std::vector<TableRow> all;
  for (const SweepScene& scene : report.scenes) {
    for (TableRow& row : figure_rows(scene, report.options.wrong)) all.push_back(std::move(row));
  }
  return table_csv(all);
}

nlohmann::ordered_json sweep_json(const SweepReport& report) {
  using Json = nlohmann::ordered_json;
  Json json;
  json["format"] = "blindcorner.sweep/1";
  json["captures"] = report.options.captures;
  json["seed"] = report.options.seed;
  json["truth_sampling"] = report.options.sampling;
  json["true_light"] = !report.options.traced.empty()                 ? "tracer"
                       : report.options.light == TrueLight::reference ? "reference"
                                                                      : "sensor";
  json["wrong"] = report.options.wrong;
  const SweepVerdict& verdict = report.verdict;
  json["headline"] = verdict.headline();
  json["remarks"] = verdict.remarks();
  json["default_on_front"] = verdict.better.empty();
  json["pictures"] = verdict.pictures;
  json["pictures_with_default_on_front"] = verdict.on_front;
  json["ratios"] = table_json(ratio_rows(verdict));
  json["scenes"] = Json::array();
  for (const SweepScene& scene : report.scenes) {
    Json entry{{"scene", scene.name}, {"file", scene.file}, {"pulse_m", scene.pulse}};
    entry["levels"] = Json::array();
    const std::vector<TableRow> rows = figure_rows(scene, report.options.wrong);
    std::size_t next = 0;
    for (const SweepLevel& level : scene.levels) {
      Json one{{"photons", level.photons},
               {"exposures", level.exposure.exposures},
               {"ambient_counts_per_bin", level.exposure.ambient},
               {"bound_median_m", number_or_null(level.bound_median)},
               {"bound_p90_m", number_or_null(level.bound_p90)},
               {"bound_rms_m", number_or_null(level.bound_rms)}};
      one["methods"] = Json::array();
      for (std::size_t m = 0; m < scene.methods.size(); ++m) {
        Json method = table_json(rows[next++]);
        nlohmann::json distances = nlohmann::json::array();
        for (const SweepTrial& t : level.cells[m].trials) {
          distances.push_back(number_or_null(t.error.empty() ? t.distance : std::nan("")));
        }
        method["errors_m"] = std::move(distances);
        one["methods"].push_back(std::move(method));
      }
      entry["levels"].push_back(std::move(one));
    }
    json["scenes"].push_back(std::move(entry));
  }
  return json;
}

std::string sweep_svg(const SweepReport& report) {
  constexpr int kWidth = 370, kHeight = 300;  // pixels of a picture
  std::string pictures;
  int row = 0;
  std::size_t columns = 0;
  for (const SweepScene& scene : report.scenes) {
    for (std::size_t i = 0; i < scene.levels.size(); ++i) {
      Chart chart = level_picture(scene, scene.levels[i], following_ms, median_of,
                                  scene.levels[i].bound_median, "median error, m");
      chart.title = scene.name + ", " + chart.title;
      chart.width = kWidth;
      chart.height = kHeight;
      pictures += formatted("<g transform=\"translate(%d,%d)\">", static_cast<int>(i) * kWidth,
                            row * kHeight) +
                  chart_svg(chart) + "</g>\n";
    }
    columns = std::max(columns, scene.levels.size());
    ++row;
  }
  return formatted(
             "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" "
             "font-family=\"sans-serif\" font-size=\"12\">\n"
             "<rect width=\"100%%\" height=\"100%%\" fill=\"#fff\"/>\n",
             static_cast<int>(columns) * kWidth, row * kHeight) +
         pictures + "</svg>\n";
}

std::string sweep_page(const SweepReport& report) {
  const SweepOptions& options = report.options;
  std::string body = "<ul>";
  for (const std::string& remark : report.verdict.remarks()) {
    body += "<li>" + html_safe(remark) + "\n";
  }
  body += "</ul>\n";
  body += formatted(
      "<p>%d captures of each scene at each level of light, the same for all methods, seed %llu. ",
      options.captures, static_cast<unsigned long long>(options.seed));
  const char* const drawn =
      "Poses and brightness come from the scene's priors, the light from the ";
  if (!options.traced.empty()) {
    body += "Poses and light come from an independent path tracer.";
  } else if (options.light == TrueLight::reference) {
    body += std::string(drawn) +
            "reference renderer, which sums pair by pair at other points than the fit.";
  } else {
    body += std::string(drawn) + "simulated sensor, which samples at other points than the fit.";
  }
  if (!options.wrong.empty()) {
    body += " The true scene has one effect that no method is told of: <b>" +
            html_safe(options.wrong) + "</b>.";
  }
  body +=
      "</p>\n<p>The exposure is the same for all captures of a level: objects of the stated "
      "brightness then send so many photons on average over the search region, over an equal "
      "background. Times are processor time of all threads, a first capture with all that a method "
      "prepares for it, a following one in the median. Error is the distance of the answer (of "
      "the solver: the mean of its posterior) from the truth. The front joins what no other "
      "method beats in both, as the figures stand; whether the default is on it is judged within "
      "their intervals. The bound's line is what errors would be that are normal with Cramer "
      "and Rao's bound, the prior counted, as their covariance. Point at a mark to see its "
      "name.</p>\n";
  body += charts_html({ratio_chart(report.verdict)}) + table_html(ratio_rows(report.verdict));
  for (const SweepScene& scene : report.scenes) body += scene_html(scene);
  return plain_page("Error against run time", report.verdict.headline(), body);
}

}  // namespace blindcorner
