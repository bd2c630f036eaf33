// SPDX-License-Identifier: Apache-2.0
#include "report/coverage_page.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <variant>

#include "report/chart.h"
#include "report/claim_table.h"
#include "report/colours.h"
#include "report/formatted.h"
#include "report/html.h"
#include "report/json_values.h"

namespace blindcorner {
namespace {

/// Number of samples that a chart shows of a posterior.
constexpr int kShownSamples = 400;

std::string light_of(const CoverageLevel& level) {
  return level.photons ? formatted("%g photons on average", *level.photons)
                       : std::string("the scene's own exposure");
}

std::string share_text(int part, int whole) {
  const ShareInterval interval = exact_interval(part, whole);
  return formatted("%.3f (%.3f to %.3f)", whole > 0 ? 1.0 * part / whole : 0.0, interval.low,
                   interval.high);
}

std::string warnings_text(const WarningShares& w) {
  return formatted(
      "several modes in %.1f %%, an open unknown in %.1f %%, a misfit in %.1f %%, unexplained "
      "light in "
      "%.1f %%, an optimum at a bound in %.1f %%, any warning in %.1f %%; outside of the 95 %% "
      "region without a warning: "
      "%.1f %%",
      100 * w.multimodal, 100 * w.undetermined, 100 * w.misfit, 100 * w.unexplained,
      100 * w.at_bound, 100 * w.warned, 100 * w.unwarned);
}

std::string truth_text(const CoverageLevel& level) {
  if (!level.truth_error) return {};
  std::string text = formatted(
      "Half the sampling of the truth (%g times the usual one) adds %.3f to the mean squared "
      "normalised error, so that its own adds less. ",
      level.sampling, *level.truth_error);
  if (*level.truth_error > kMaxTruthError) {
    text += "WARNING: that is not small; ask for a denser truth (--truth, --dense-truth). ";
  }
  return text;
}

std::string level_text(const CoverageLevel& level) {
  const auto far = std::ranges::count_if(
      level.trials, [](const ClaimTrial& t) { return !t.error.empty() || t.level > 0.99; });
  const double outside = static_cast<double>(far) / static_cast<double>(level.trials.size());
  return truth_text(level) +
         formatted(
             "%d captures, %d of them without an answer; photons of the object: median %.3g; "
             "median error %.4f m, median claimed %.4f m; mean squared normalised error by "
             "Student's t, which does not take errors for normal: %.3f to %.3f; outside of the "
             "99 %% region: %.1f %%. ",
             static_cast<int>(level.trials.size()), level.failures, level.median_photons,
             level.median_error, level.median_claimed, level.mean_square_low,
             level.mean_square_high, 100 * outside);
}

/// The share of right modes against the weight that was stated for them.
Chart weight_chart(const CoverageLevel& level) {
  Chart chart{"weights of modes", "stated", "right"};
  chart.width = 380;
  chart.height = 340;
  ChartSeries honest{"honest", {{0, 0}, {1, 1}}, SeriesStyle::line, colour::kLine};
  ChartSeries found{"found", {}, SeriesStyle::marked_line, colour::kFound};
  ChartSeries low{"allowed", {}, SeriesStyle::line, "var(--series-5,#3a8fd0)"};
  ChartSeries high{"", {}, SeriesStyle::line, "var(--series-5,#3a8fd0)"};
  for (const ClaimTest& c : level.claims) {
    if (c.what.find("weight") == std::string::npos) continue;
    found.points.push_back({c.claimed, c.found, formatted("%d modes", c.trials)});
    low.points.push_back({c.claimed, c.low});
    high.points.push_back({c.claimed, c.high});
  }
  chart.series = {honest, low, high, found};
  return chart;
}

/// Share of truths inside the regions, against the claimed level of the regions.
Chart level_chart(const CoverageLevel& level) {
  Chart chart{"regions", "claimed", "share of truths inside"};
  chart.width = 380;
  chart.height = 340;
  ChartSeries honest{"honest", {{0, 0}, {1, 1}}, SeriesStyle::line, colour::kLine};
  ChartSeries found{"found", {{0, 0}}, SeriesStyle::line, colour::kFound};
  std::vector<double> levels;
  for (const ClaimTrial& t : level.trials) {
    if (t.error.empty()) levels.push_back(t.level);
  }
  std::ranges::sort(levels);
  for (int i = 1; i <= 100; ++i) {
    const double claimed = 0.01 * i;
    const auto inside = std::ranges::upper_bound(levels, claimed) - levels.begin();
    found.points.push_back(
        {claimed, static_cast<double>(inside) / static_cast<double>(level.trials.size())});
  }
  chart.series = {honest, found};
  return chart;
}

/// A row for each wrong assumption that was not left out.
std::vector<TableRow> wrong_rows(const Scene& scene, const CoverageLevel& level) {
  std::vector<TableRow> rows;
  for (const WrongFigures& w : level.wrong) {
    if (w.captures == 0) continue;
    const double n = w.captures;
    rows.push_back({{{"scene", "", "", scene.name},
                     {"photons", "", "", photons_cell(level)},
                     {"wrong", "wrong", "%-30s", w.assumption.name},
                     {"captures", "captures", "%8d", w.captures},
                     {"failures", "", "", w.failures},
                     {"in_50", "", "", w.held[0]},
                     {"in_90", "", "", w.held[1]},
                     {"in_95", "", "", w.held[2]},
                     {"", "in 50 %", "%6.3f", w.held[0] / n},
                     {"", "90 %", "%6.3f", w.held[1] / n},
                     {"", "95 %", "%6.3f", w.held[2] / n},
                     {"claimed_growth", "growth", "%7.2f", w.claimed_growth},
                     {"median_error_m", "error m", "%9.4f", w.median_error},
                     {"right_median_error_m", "(right) m", "%9.4f", w.right_median_error},
                     {"misfit", "misfit", "%7.2f", w.warnings.misfit},
                     {"unexplained_light", "light", "%7.2f", w.warnings.unexplained},
                     {"flagged", "warned", "%7.2f", w.warnings.warned},
                     {"outside_of_95_without_warning", "", "", w.unwarned},
                     {"", "unwarned (95 %)", "%22s", share_text(w.unwarned, w.captures)},
                     {"holds", "", "", w.holds},
                     {"flagged_by_the_best_test", "best", "%7.2f", w.best_warned},
                     {"outside_of_95_without_the_best_test", "unwarned", "%9.3f", w.best_unwarned},
                     {"", "verdict", "%7s", w.holds ? "holds" : "FAILS"}},
                    !w.holds});
  }
  return rows;
}

/// What was left out and why, a line each, with `before` and `after` around it.
std::string left_out(const CoverageLevel& level, const char* before, const char* after) {
  std::string text;
  for (const WrongFigures& w : level.wrong) {
    if (w.captures > 0) continue;
    text += before + w.assumption.name + " left out: " + w.assumption.left_out + after;
  }
  return text;
}

std::string wrong_html(const Scene& scene, const CoverageLevel& level) {
  if (level.wrong.empty()) return {};
  return "<p>With a wrong assumption, on the first of these objects. <i>Growth</i> is the median "
         "ratio of the claimed uncertainty to that under the right assumption; <i>light</i> stands "
         "for unexplained light, <i>unwarned</i> for outside of the 95 % region without any "
         "warning, <i>best</i> for the best test that knows what is wrong.</p>\n" +
         table_html(wrong_rows(scene, level)) + left_out(level, "<p>", "</p>\n");
}

/// Samples of a posterior over two unknowns.
Chart posterior_chart(const Scene& scene, const AmbiguousExample& example) {
  const std::vector<std::string> names = unknown_names(scene);
  const bool two = names.size() > 1;
  Chart chart{"a posterior: " + (example.flags.empty() ? std::string() : example.flags.front()),
              names.front(), two ? names[1] : "number of the sample"};
  chart.width = 380;
  chart.height = 340;
  ChartSeries samples{"samples of the posterior", {}, SeriesStyle::dots, colour::kModel};
  ChartSeries modes{"modes", {}, SeriesStyle::marks, colour::kFound};
  ChartSeries truth{"truth", {}, SeriesStyle::circles, colour::kTruth};
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::vector<double> weights;
  for (const PoseMode& mode : example.posterior.modes) weights.push_back(mode.weight);
  std::discrete_distribution<std::size_t> pick(weights.begin(), weights.end());
  for (int i = 0; i < kShownSamples; ++i) {
    const PoseMode& mode = example.posterior.modes[pick(random)];
    const Eigen::MatrixXd factor = mode.covariance.llt().matrixL();
    const PoseVector at = mode.pose + factor * PoseVector::NullaryExpr(mode.pose.size(), [&] {
                                        return normal(random);
                                      });
    samples.points.push_back({at[0], two ? at[1] : i});
  }
  for (const PoseMode& mode : example.posterior.modes) {
    modes.points.push_back(
        {mode.pose[0], two ? mode.pose[1] : 0, formatted("weight %.2f", mode.weight)});
  }
  truth.points.push_back({example.truth[0], two ? example.truth[1] : 0});
  chart.series = {samples, modes, truth};
  return chart;
}

std::string level_html(const CoverageScene& scene, const CoverageLevel& level) {
  std::vector<Chart> charts{level_chart(level), weight_chart(level)};
  if (level.example) charts.push_back(posterior_chart(scene.scene, *level.example));
  return "<h2>" + html_safe(scene.scene.name) + ", " + light_of(level) + "</h2>\n<p>" +
         level_text(level) + "Captures show " + warnings_text(level.warnings) + ".</p>\n" +
         table_html(claim_rows(scene.scene, level)) + charts_html(charts) +
         wrong_html(scene.scene, level);
}

nlohmann::ordered_json warnings_json(const WarningShares& w) {
  return {{"multimodal", w.multimodal},
          {"undetermined", w.undetermined},
          {"model_misfit", w.misfit},
          {"unexplained_light", w.unexplained},
          {"at_bound", w.at_bound},
          {"any", w.warned},
          {"outside_of_95_without_warning", w.unwarned}};
}

nlohmann::ordered_json wrong_json(const WrongFigures& w) {
  nlohmann::ordered_json json{{"assumption", w.assumption.name},
                              {"description", w.assumption.description},
                              {"captures", w.captures}};
  if (w.captures == 0) {
    json["left_out"] = w.assumption.left_out;
    return json;
  }
  json["failures"] = w.failures;
  json["in_50"] = w.held[0];
  json["in_90"] = w.held[1];
  json["in_95"] = w.held[2];
  json["claimed_growth"] = number_or_null(w.claimed_growth);
  json["median_error_m"] = number_or_null(w.median_error);
  json["right_median_error_m"] = number_or_null(w.right_median_error);
  json["flagged"] = warnings_json(w.warnings);
  json["outside_of_95_without_warning"] = w.unwarned;
  json["holds"] = w.holds;
  json["flagged_by_the_best_test"] = number_or_null(w.best_warned);
  json["outside_of_95_without_the_best_test"] = number_or_null(w.best_unwarned);
  return json;
}

double found(const CoverageLevel& level, const char* claim) {
  const auto it = std::ranges::find(level.claims, claim, &ClaimTest::what);
  return it == level.claims.end() ? std::numeric_limits<double>::quiet_NaN() : it->found;
}

std::string objects_text(const Scene& scene) {
  std::string text;
  for (int i = 0; i < object_count(scene); ++i) {
    const HiddenObject& object = hidden_object(scene, i);
    if (i > 0) text += ", ";
    if (std::holds_alternative<RetroreflectiveMaterial>(object.material)) text += "retro ";
    if (const auto* other = std::get_if<BrdfMaterial>(&object.material)) text += other->name + ' ';
    text += shape_name(object.shape);
  }
  return text;
}

std::string unknowns_text(const Scene& scene) {
  std::string text;
  for (const std::string& name : unknown_names(scene)) {
    text += (text.empty() ? "" : " ") + name.substr(0, name.find_last_of('_'));
  }
  return text;
}

/// A row for each scene and level of light: what a reader of many scenes looks at first.
std::vector<TableRow> summary_rows(const Scene& scene, const CoverageLevel& level) {
  const bool holds = std::ranges::all_of(level.claims, &ClaimTest::holds);
  return {
      {{{"", "scene", "%-14s", scene.name},
        {"", "sensor", "%-18s", scene.sensor.name},
        {"", "object", "%-16s", objects_text(scene)},
        {"", "unknowns", "%-14s", unknowns_text(scene)},
        {"", "photons", "%8.3g", photons_cell(level)},
        {"", "in 50 %", "%7.3f", found(level, "truth in the 50 % region")},
        {"", "in 95 %", "%7.3f", found(level, "truth in the 95 % region")},
        {"", "square", "%8.3f", found(level, "mean squared normalised error")},
        {"", "of truth", "%8.3f", level.truth_error ? TableCell(*level.truth_error) : TableCell()},
        {"", "warned", "%7.2f", level.warnings.warned},
        {"", "verdict", "%7s", holds ? "holds" : "FAILS"}},
       !holds}};
}

nlohmann::ordered_json trial_json(const ClaimTrial& t) {
  if (!t.error.empty()) return {{"error", t.error}};
  std::vector<double> weights;
  for (const ModeClaim& mode : t.modes) weights.push_back(mode.weight);
  return {{"truth", std::vector<double>(t.truth.begin(), t.truth.end())},
          {"mean", std::vector<double>(t.mean.begin(), t.mean.end())},
          {"photons", number_or_null(t.photons)},
          {"level", t.level},
          {"normalised_square", number_or_null(t.normalised_square)},
          {"error_m", number_or_null(t.distance)},
          {"claimed_m", number_or_null(t.claimed)},
          {"deviance_excess", number_or_null(t.deviance_excess)},
          {"weights", weights},
          {"flags", t.flags}};
}

nlohmann::ordered_json coverage_level_json(const Scene& scene, const CoverageLevel& level) {
  nlohmann::ordered_json json = level_json(level);
  json["median_photons"] = level.median_photons;
  json["median_error_m"] = number_or_null(level.median_error);
  json["median_claimed_m"] = number_or_null(level.median_claimed);
  json["mean_square_low"] = number_or_null(level.mean_square_low);
  json["mean_square_high"] = number_or_null(level.mean_square_high);
  json["truth_sampling"] = level.sampling;
  if (level.truth_error) json["truth_error"] = number_or_null(*level.truth_error);
  json["claims"] = table_json(claim_rows(scene, level));
  json["flagged"] = warnings_json(level.warnings);
  json["wrong"] = nlohmann::ordered_json::array();
  for (const WrongFigures& w : level.wrong) json["wrong"].push_back(wrong_json(w));
  json["trials"] = nlohmann::ordered_json::array();
  for (const ClaimTrial& t : level.trials) json["trials"].push_back(trial_json(t));
  return json;
}

}  // namespace

std::string coverage_headline(const CoverageReport& report) {
  const ClaimCount count = count_claims(report.scenes);
  int wrong = 0, warned = 0;
  for (const CoverageScene& scene : report.scenes) {
    for (const CoverageLevel& level : scene.levels) {
      for (const WrongFigures& w : level.wrong) {
        wrong += w.captures > 0 ? 1 : 0;
        warned += w.captures > 0 && w.holds ? 1 : 0;
      }
    }
  }
  std::string text = formatted(
      "With the model right, %d of %d claims hold; all would, with 95 %%, if every claim were "
      "true.",
      count.holding, count.claims);
  if (wrong > 0) {
    text += formatted(
        " With something wrong in the scene, uncertainty grows or the fit warns in %d of %d rows.",
        warned, wrong);
  }
  return text;
}

std::string coverage_text(const CoverageScene& scene) {
  std::string text;
  for (const CoverageLevel& level : scene.levels) {
    text += scene.scene.name + ", " + light_of(level) + "\n" + level_text(level) + "\n" +
            warnings_text(level.warnings) + "\n" + table_text(claim_rows(scene.scene, level));
    if (level.wrong.empty()) continue;
    text += table_text(wrong_rows(scene.scene, level)) + left_out(level, "", "\n");
  }
  return text;
}

std::string coverage_summary(const CoverageReport& report) {
  return table_text(all_rows(report.scenes, summary_rows));
}

std::string coverage_csv(const CoverageReport& report) {
  return table_csv(all_rows(report.scenes, claim_rows));
}

std::string wrong_assumptions_csv(const CoverageReport& report) {
  return table_csv(all_rows(report.scenes, wrong_rows));
}

nlohmann::ordered_json coverage_json(const CoverageReport& report) {
  nlohmann::ordered_json json =
      study_json("blindcorner.coverage/1", report.options, coverage_headline(report));
  json["scenes"] = scenes_json(report.scenes, coverage_level_json);
  return json;
}

std::string coverage_page(const CoverageReport& report) {
  std::string body;
  body += formatted(
      "<p>%d captures of each scene and level of light, seed %llu. Poses and brightness are drawn "
      "from the priors that the fit is told; the light is ",
      report.options.captures, static_cast<unsigned long long>(report.options.seed));
  body += report.options.light == TrueLight::reference
              ? "the reference renderer's, which is not the fit's model.</p>\n"
              : "the simulated sensor's, which is off by 1 to 2 %.</p>\n";
  body += std::string("<p>A claim holds where what was found lies within what is allowed: ") +
          kJudgedTogether +
          " Captures without an answer count as outside. A mode is right where the truth most "
          "likely comes from it and lies in its 99.9 % region, by Student's t: modes need not be "
          "normal.</p>\n";
  const std::vector<TableRow> rows = all_rows(report.scenes, summary_rows);
  if (rows.size() > 1) body += table_html(rows);
  for (const CoverageScene& scene : report.scenes) {
    for (const CoverageLevel& level : scene.levels) body += level_html(scene, level);
  }
  return plain_page("Whether the uncertainty is what it says", coverage_headline(report), body);
}

}  // namespace blindcorner
