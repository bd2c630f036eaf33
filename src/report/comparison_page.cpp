// SPDX-License-Identifier: Apache-2.0
#include "report/comparison_page.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "blindcorner/report/headline.h"
#include "report/formatted.h"
#include "report/html.h"
#include "report/interval_chart.h"
#include "report/reading_units.h"

namespace blindcorner {
namespace {

using Json = nlohmann::ordered_json;

/// Columns of the CSV: all unknowns that a scene of one object may have.
const char* const kUnknowns[] = {"x_m", "y_m", "z_m", "yaw_rad", "size"};

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json interval_json(const BootstrapInterval& interval) {
  return {{"value", number(interval.value)},
          {"low", number(interval.low)},
          {"high", number(interval.high)}};
}

Json optional_json(const std::optional<BootstrapInterval>& interval) {
  return interval ? interval_json(*interval) : Json(nullptr);
}

BootstrapInterval milliseconds(const BootstrapInterval& seconds) {
  return {1e3 * seconds.value, 1e3 * seconds.low, 1e3 * seconds.high};
}

Json method_json(const SceneComparison& scene, const MethodFigures& figures) {
  Json json;
  json["method"] = figures.method;
  json["answers"] = figures.answers;
  json["failures"] = figures.failures;
  if (figures.failures > 0) json["first_error"] = figures.first_error;
  json["position_median_m"] = interval_json(figures.position);
  json["position_p90_m"] = interval_json(figures.p90);
  json["rmse_m"] = interval_json(figures.rmse);
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    json["mean_absolute"][scene.unknowns[i]] = interval_json(figures.mean_absolute[i]);
  }
  json["coverage_95"] = nullptr;
  if (figures.claim) {
    json["coverage_95"] = {{"share", figures.claim->share},
                           {"low", figures.claim->interval.low},
                           {"high", figures.claim->interval.high},
                           {"claims", figures.claim->claims}};
  }
  json["time_ms"] = interval_json(milliseconds(figures.time));
  json["difference_from_solver_m"] = optional_json(figures.against_first);
  json["yaw_difference_from_solver_rad"] = optional_json(figures.yaw_against_first);
  return json;
}

Json condition_json(const SceneComparison& scene, const ConditionFigures& figures) {
  Json json;
  json["condition"] = figures.condition.name;
  json["description"] = figures.condition.description;
  json["wrong"] = figures.condition.wrong;
  json["left_out"] =
      figures.condition.left_out.empty() ? Json(nullptr) : Json(figures.condition.left_out);
  json["methods"] = Json::array();
  for (const MethodFigures& m : figures.methods) json["methods"].push_back(method_json(scene, m));
  json["findings"] = figures.findings;
  return json;
}

std::string claim_text(const MethodFigures& m) {
  if (!m.claim) return "-";
  return formatted("%.2f (%.2f to %.2f)", m.claim->share, m.claim->interval.low,
                   m.claim->interval.high);
}

std::string position_text(const BootstrapInterval& i) {
  return formatted("%.3f (%.3f to %.3f)", i.value, i.low, i.high);
}

/// "|x_m|": heading of a column with mean absolute errors.
std::string heading(const std::string& unknown) { return "|" + reading_name(unknown) + "|"; }

/// An interval of this unknown, in the unit that readers see.
BootstrapInterval shown(const std::string& unknown, const BootstrapInterval& i) {
  const double unit = reading_unit(unknown);
  return {unit * i.value, unit * i.low, unit * i.high};
}

/// A figure with its interval below it.
std::string cell(const std::string& value, const std::string& low, const std::string& high) {
  return "<td>" + value + "<br><small>" + low + " to " + high + "</small>";
}

std::string cell(const BootstrapInterval& i, const char* pattern = "%.3f") {
  if (!std::isfinite(i.value)) return "<td>-";
  return cell(formatted(pattern, i.value), formatted(pattern, i.low), formatted(pattern, i.high));
}

std::string cell(const std::optional<BootstrapInterval>& i) {
  return i ? cell(*i, "%+.3f") : "<td>-";
}

std::string cell(const std::optional<ClaimFigures>& claim) {
  if (!claim) return "<td>-";
  return cell(formatted("%.2f", claim->share), formatted("%.2f", claim->interval.low),
              formatted("%.2f", claim->interval.high));
}

/// The method's name, bold if the method is better than the solver: the interval of its difference
/// in position or in yaw lies below 0.
std::string method_cell(const MethodFigures& m) {
  const auto better = [](const std::optional<BootstrapInterval>& difference) {
    return difference && difference->high < 0;
  };
  const bool bold = better(m.against_first) || better(m.yaw_against_first);
  return bold ? "<b>" + html_safe(m.method) + "</b>" : html_safe(m.method);
}

bool yaw_is_known(const SceneComparison& scene) {
  return std::ranges::find(scene.unknowns, "yaw_rad") == scene.unknowns.end();
}

std::string table_html(const SceneComparison& scene) {
  std::string head = "<tr><th>method<th>position, median, m<th>90 % within, m<th>RMSE, m";
  for (const std::string& unknown : scene.unknowns) head += "<th>" + html_safe(heading(unknown));
  head += "<th>truth in the 95 % region<th>median less the solver's, m";
  if (!yaw_is_known(scene)) head += "<th>|yaw_deg| less the solver's";
  head += "<th>ms a capture<th>failed</tr>\n";
  const auto columns = std::ranges::count(head, '<') - 2;
  std::string html = "<table style=\"white-space:nowrap;font-size:11px\">" + head;
  for (const ConditionFigures& c : scene.conditions) {
    html += formatted("<tr><th colspan=\"%td\" style=\"text-align:left\">", columns) +
            html_safe(c.condition.name) +
            (c.condition.left_out.empty() ? "" : ": left out: " + html_safe(c.condition.left_out)) +
            "</tr>\n";
    for (const MethodFigures& m : c.methods) {
      html += "<tr><td style=\"text-align:left\">" + method_cell(m) + cell(m.position) +
              cell(m.p90) + cell(m.rmse);
      for (std::size_t k = 0; k < m.mean_absolute.size(); ++k) {
        html += cell(shown(scene.unknowns[k], m.mean_absolute[k]));
      }
      html += cell(m.claim) + cell(m.against_first);
      if (!yaw_is_known(scene)) {
        const auto& yaw = m.yaw_against_first;
        html += cell(yaw ? std::optional(shown("yaw_rad", *yaw)) : std::nullopt);
      }
      html += cell(milliseconds(m.time), "%.3g") + formatted("<td>%d</tr>\n", m.failures);
    }
  }
  return html + "</table>\n";
}

std::string published_html(const std::vector<PublishedFigure>& published) {
  if (published.empty()) return {};
  std::string html = "<p>Published elsewhere, RMSE in m: ";
  for (std::size_t i = 0; i < published.size(); ++i) {
    html +=
        (i > 0 ? ", " : "") + html_safe(published[i].name) + formatted(" %.3f", published[i].rmse);
  }
  return html + ".</p>\n";
}

std::string chart(const SceneComparison& scene) {
  std::vector<IntervalRow> rows;
  for (const ConditionFigures& c : scene.conditions) {
    if (c.methods.empty()) continue;
    rows.push_back({c.condition.name, {}});
    for (const MethodFigures& m : c.methods) {
      rows.back().marks.push_back({m.method, m.position.value, m.position.low, m.position.high});
    }
  }
  return intervals_svg("median distance from the truth, m, with 95 % intervals", rows);
}

std::string methods_html(const SceneComparison& scene) {
  std::string html = "<table><tr><th>method<th class=\"text\">training</tr>\n";
  for (const ComparedMethod& m : scene.methods) {
    html +=
        "<tr><td>" + html_safe(m.name) + "<td class=\"text\">" + html_safe(m.training) + "</tr>\n";
  }
  return html + "</table>\n";
}

std::string findings_html(const SceneComparison& scene) {
  std::string items;
  for (const ConditionFigures& c : scene.conditions) {
    for (const std::string& sentence : c.findings) items += "<li>" + html_safe(sentence) + "\n";
  }
  if (items.empty()) {
    return "<p>Under no condition does another method have a smaller median error, or a smaller "
           "mean "
           "error of yaw, than the solver by more than the captures leave open.</p>\n";
  }
  return "<p>Where another method is better than the solver (bold in the table):</p>\n<ul>" +
         items + "</ul>\n";
}

std::string conditions_html(const SceneComparison& scene) {
  std::string html = "<ul>";
  for (const ConditionFigures& c : scene.conditions) {
    html += "<li><b>" + html_safe(c.condition.name) + "</b>: " + html_safe(c.condition.description);
    if (!c.condition.wrong.empty()) html += " Not told: " + html_safe(c.condition.wrong) + ".";
    html += "\n";
  }
  return html + "</ul>\n";
}

std::string pictures_html(const std::vector<ComparisonPicture>& pictures) {
  if (pictures.empty()) return {};
  std::string html =
      "<p>Seen from above, y up. Green: true places; orange: answers, joined to them; large dots: "
      "sensors; dashed: the search region.</p>\n<div "
      "style=\"display:grid;"
      "grid-template-columns:repeat(auto-fit,minmax(300px,1fr));gap:12px\">\n";
  for (const ComparisonPicture& p : pictures) {
    html += "<div><p>" + html_safe(p.title) + "</p>" + p.svg + "</div>\n";
  }
  return html + "</div>\n";
}

/// For each scene, the method with the least median error under the first condition.
std::string comparison_headline(const ComparisonReport& report) {
  std::string text;
  for (const SceneComparison& scene : report.scenes) {
    if (scene.conditions.empty() || scene.conditions.front().methods.empty()) continue;
    const std::vector<MethodFigures>& methods = scene.conditions.front().methods;
    const auto error = [](const MethodFigures& m) {
      return std::isfinite(m.position.value) ? m.position.value : HUGE_VAL;
    };
    const MethodFigures& best = *std::ranges::min_element(methods, {}, error);
    if (!std::isfinite(best.position.value)) continue;
    text += (text.empty() ? "" : " ") +
            formatted("On %s the smallest error is that of ", scene.scene.c_str()) + best.method +
            ": half of its answers are within " + said_length(best.position.value) +
            " of the truth.";
  }
  return text;
}

}  // namespace

std::vector<std::string> comparison_conventions(const ComparisonReport& report) {
  const std::string told =
      report.simulated
          ? "All methods are told the scene as its file has it, and answer the same captures."
          : "All methods answer the same measured captures. The solver and the classical methods "
            "are told the scene as it is calibrated with the captures that are learnt; networks "
            "learn these (and samples of fewer exposures of the same places, where there are).";
  return {
      "Errors per axis and of yaw, in bars, are mean absolute errors over the captures; yaw is "
      "compared modulo the symmetry of the object's shape.",
      "The distance of position is Euclidean over all unknown coordinates.",
      "Below each figure stands its 95 % interval: of 2000 bootstrap draws over places of the "
      "object; of shares Wilson's.",
      "RMSE is the root of the mean square over all captures and coordinates of position, as "
      "published for CheapSPAD.",
      "The solver answers the mean of its posterior. Coverage is the share of captures whose true "
      "pose lies in the 95 % region of highest density, as is that of an ensemble of networks; the "
      "other methods claim no region.",
      "Differences from the solver are between medians (of yaw means) of the same captures; each "
      "draw takes both.",
      "Times are wall clock per capture, medians, captures shared among the threads, preparation "
      "of a new sensor pose included.",
      told};
}

std::string comparison_text(const SceneComparison& scene) {
  std::string text = formatted("%s\n%-33s %-20s %-27s %8s %-24s", scene.scene.c_str(), "condition",
                               "method", "position median, m (95 %)", "90 %", "RMSE, m (95 %)");
  for (const std::string& unknown : scene.unknowns) {
    text += formatted(" %9s", heading(unknown).c_str());
  }
  text += formatted(" %-21s %9s %7s\n", "coverage of 95 %", "ms", "failed");
  for (const ConditionFigures& c : scene.conditions) {
    const char* name = c.condition.name.c_str();
    if (!c.condition.left_out.empty()) {
      text += formatted("%-33s left out: %s\n", name, c.condition.left_out.c_str());
    }
    for (const MethodFigures& m : c.methods) {
      text +=
          formatted("%-33s %-20s %-27s %8.4f %-24s", name, m.method.c_str(),
                    position_text(m.position).c_str(), m.p90.value, position_text(m.rmse).c_str());
      for (std::size_t k = 0; k < m.mean_absolute.size(); ++k) {
        text += formatted(" %9.4f", shown(scene.unknowns[k], m.mean_absolute[k]).value);
      }
      text +=
          formatted(" %-21s %9.3g %7d\n", claim_text(m).c_str(), 1e3 * m.time.value, m.failures);
      name = "";
    }
  }
  for (const ConditionFigures& c : scene.conditions) {
    for (const std::string& sentence : c.findings) text += sentence + "\n";
  }
  return text;
}

std::string comparison_csv(const std::vector<SceneComparison>& scenes) {
  std::string csv = "scene,condition,method,answers,failures";
  const auto add_heads = [&csv](const std::string& name, const std::string& unit) {
    csv += "," + name + unit + "," + name + "_low" + unit + "," + name + "_high" + unit;
  };
  add_heads("position_median", "_m");
  add_heads("position_p90", "_m");
  add_heads("rmse", "_m");
  for (const char* unknown : kUnknowns) add_heads(std::string("mean_absolute_") + unknown, "");
  add_heads("coverage", "");
  add_heads("time", "_ms");
  add_heads("difference", "_m");
  add_heads("yaw_difference", "_rad");
  csv += "\n";
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const auto add = [&csv](const std::optional<BootstrapInterval>& interval) {
    const BootstrapInterval i = interval.value_or(BootstrapInterval{kNone, kNone, kNone});
    for (const double v : {i.value, i.low, i.high}) {
      csv += std::isfinite(v) ? formatted(",%.9g", v) : std::string(",");
    }
  };
  for (const SceneComparison& scene : scenes) {
    for (const ConditionFigures& c : scene.conditions) {
      for (const MethodFigures& m : c.methods) {
        csv += "\"" + scene.scene + "\",\"" + c.condition.name + "\",\"" + m.method + "\"" +
               formatted(",%d,%d", m.answers, m.failures);
        for (const BootstrapInterval& i : {m.position, m.p90, m.rmse}) add(i);
        for (const char* unknown : kUnknowns) {
          const auto at = std::ranges::find(scene.unknowns, unknown) - scene.unknowns.begin();
          const auto i = static_cast<std::size_t>(at);
          add(i < m.mean_absolute.size() ? std::optional(m.mean_absolute[i]) : std::nullopt);
        }
        add(m.claim ? std::optional(BootstrapInterval{m.claim->share, m.claim->interval.low,
                                                      m.claim->interval.high})
                    : std::nullopt);
        add(milliseconds(m.time));
        add(m.against_first);
        add(m.yaw_against_first);
        csv += "\n";
      }
    }
  }
  return csv;
}

nlohmann::ordered_json comparison_json(const ComparisonReport& report) {
  Json json;
  json["format"] = "blindcorner.comparison/2";
  json["seed"] = report.seed;
  if (report.simulated) {
    const DatasetOptions& dataset = report.simulated->dataset;
    json["captures"] = report.simulated->captures;
    json["dataset"] = {{"objects", dataset.objects},
                       {"sensors", dataset.sensors},
                       {"exposures", dataset.exposures},
                       {"seed", dataset.seed}};
  }
  json["published_rmse_m"] = Json::object();
  for (const PublishedFigure& p : report.published) json["published_rmse_m"][p.name] = p.rmse;
  json["conventions"] = comparison_conventions(report);
  json["scenes"] = Json::array();
  for (const SceneComparison& scene : report.scenes) {
    Json entry;
    entry["scene"] = scene.scene;
    entry["file"] = scene.file;
    entry["unknowns"] = scene.unknowns;
    entry["methods"] = Json::array();
    for (const ComparedMethod& m : scene.methods) {
      entry["methods"].push_back({{"name", m.name}, {"training", m.training}});
    }
    entry["conditions"] = Json::array();
    for (const ConditionFigures& c : scene.conditions) {
      entry["conditions"].push_back(condition_json(scene, c));
    }
    json["scenes"].push_back(entry);
  }
  return json;
}

std::string comparison_page(const ComparisonReport& report) {
  std::string body = "<p>";
  if (report.simulated) {
    body += formatted("%d simulated captures of each condition", report.simulated->captures);
  } else {
    body += "Measured captures";
  }
  body += formatted(", seed %llu.</p>\n<ul>", static_cast<unsigned long long>(report.seed));
  for (const std::string& sentence : comparison_conventions(report)) {
    body += "<li>" + html_safe(sentence) + "\n";
  }
  body += "</ul>\n";
  for (std::size_t s = 0; s < report.scenes.size(); ++s) {
    const SceneComparison& scene = report.scenes[s];
    body += "<h2>" + html_safe(scene.scene) + "</h2>\n" + findings_html(scene) + chart(scene) +
            table_html(scene) + published_html(report.published) +
            (report.simulated ? "<p>What was trained:</p>\n"
                              : "<p>What was trained, for one of the splits:</p>\n") +
            methods_html(scene) + "<p>The conditions:</p>\n" + conditions_html(scene);
    if (s < report.pictures.size()) body += pictures_html(report.pictures[s]);
  }
  return plain_page("Methods compared", comparison_headline(report), body);
}

}  // namespace blindcorner
