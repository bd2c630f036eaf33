// SPDX-License-Identifier: Apache-2.0
#include "report/comparison_page.h"

#include <algorithm>
#include <cmath>

#include "report/formatted.h"
#include "report/headline.h"
#include "report/html.h"
#include "report/interval_chart.h"

namespace blindcorner {
namespace {

using Json = nlohmann::ordered_json;

/// Columns of the CSV: whatever a scene of one object may leave open.
const char* const kUnknowns[] = {"x_m", "y_m", "z_m", "yaw_rad", "size"};

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json interval_json(const BootstrapInterval& interval) {
  return {{"value", number(interval.value)},
          {"low", number(interval.low)},
          {"high", number(interval.high)}};
}

Json method_json(const SceneComparison& scene, const MethodFigures& figures) {
  Json json;
  json["method"] = figures.method;
  json["answers"] = figures.answers;
  json["failures"] = figures.failures;
  if (figures.failures > 0) json["first_error"] = figures.first_error;
  json["position_median_m"] = interval_json(figures.position);
  json["position_p90_m"] = number(figures.p90);
  json["rmse_m"] = interval_json(figures.rmse);
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    json["mean_absolute"][scene.unknowns[i]] = number(figures.mean_absolute[i]);
  }
  json["coverage_95"] = nullptr;
  if (figures.claim) {
    json["coverage_95"] = {{"share", figures.claim->share},
                           {"low", figures.claim->interval.low},
                           {"high", figures.claim->interval.high},
                           {"claims", figures.claim->claims}};
  }
  json["time_ms"] = number(1e3 * figures.time);
  json["difference_from_solver_m"] =
      figures.against_first ? interval_json(*figures.against_first) : Json(nullptr);
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

/// "x_m" as a heading: what is in it is the mean absolute error.
std::string heading(const std::string& unknown) { return "|" + unknown + "|"; }

std::string table_html(const SceneComparison& scene) {
  std::string html =
      "<div style=\"overflow-x:auto\"><table "
      "style=\"white-space:nowrap;font-size:11px\"><tr><th>condition<th>method<th>position "
      "median, m (95 "
      "%)<th>90 %, m<th>RMSE, m (95 %)";
  for (const std::string& unknown : scene.unknowns) html += "<th>" + html_safe(heading(unknown));
  html += "<th>coverage of 95 %<th>less solver, m (95 %)<th>ms<th>failed</tr>\n";
  for (const ConditionFigures& c : scene.conditions) {
    std::string name = html_safe(c.condition.name);
    if (!c.condition.left_out.empty()) {
      html += "<tr><td>" + name + "<td colspan=\"" + std::to_string(scene.unknowns.size() + 8) +
              "\">left out: " + html_safe(c.condition.left_out) + "</tr>\n";
    }
    for (const MethodFigures& m : c.methods) {
      html += "<tr><td>" + name + "<td>" + html_safe(m.method) + "<td>" +
              position_text(m.position) + formatted("<td>%.3f<td>", m.p90) + position_text(m.rmse);
      for (const double mean : m.mean_absolute) html += formatted("<td>%.3f", mean);
      html += "<td>" + claim_text(m) + "<td>" +
              (m.against_first ? position_text(*m.against_first) : "-") +
              formatted("<td>%.3g<td>%d</tr>\n", 1e3 * m.time, m.failures);
      name.clear();
    }
  }
  return html + "</table></div>\n";
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
    return "<p>Under no condition does another method have a smaller median error than the solver "
           "by more than the captures leave open.</p>\n";
  }
  return "<p>Where another method is better than the solver:</p>\n<ul>" + items + "</ul>\n";
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

/// Scene by scene the method with the least median error under the first condition.
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
      "Errors per axis and of yaw are mean absolute errors over the captures; yaw is compared "
      "modulo "
      "the symmetry of the object's shape.",
      "The distance of position is Euclidean over all unknown coordinates; its median stands with "
      "the 95 % interval of 2000 bootstrap draws over places of the object.",
      "RMSE is the root of the mean square over all captures and coordinates of position, as "
      "published for CheapSPAD.",
      "The solver answers the mean of its posterior. Coverage is the share of captures whose true "
      "pose lies in the 95 % region of highest density, with Wilson's 95 % interval, as is that of "
      "an ensemble of networks; the other methods claim no region.",
      "Differences from the solver are between medians of the same captures; each draw takes both.",
      "Times are wall clock per capture, medians, captures shared among the threads, preparation "
      "of "
      "a new sensor pose included.",
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
      text += formatted("%-33s %-20s %-27s %8.4f %-24s", name, m.method.c_str(),
                        position_text(m.position).c_str(), m.p90, position_text(m.rmse).c_str());
      for (const double mean : m.mean_absolute) text += formatted(" %9.4f", mean);
      text += formatted(" %-21s %9.3g %7d\n", claim_text(m).c_str(), 1e3 * m.time, m.failures);
      name = "";
    }
  }
  for (const ConditionFigures& c : scene.conditions) {
    for (const std::string& sentence : c.findings) text += sentence + "\n";
  }
  return text;
}

std::string comparison_csv(const std::vector<SceneComparison>& scenes) {
  std::string csv =
      "scene,condition,method,answers,failures,position_median_m,position_low_m,position_high_m,"
      "position_p90_m,rmse_m,rmse_low_m,rmse_high_m";
  for (const char* unknown : kUnknowns) csv += std::string(",mean_absolute_") + unknown;
  csv +=
      ",coverage,coverage_low,coverage_high,time_ms,difference_m,difference_low_m,"
      "difference_high_m\n";
  const auto cell = [](double v) {
    return std::isfinite(v) ? formatted(",%.9g", v) : std::string(",");
  };
  for (const SceneComparison& scene : scenes) {
    for (const ConditionFigures& c : scene.conditions) {
      for (const MethodFigures& m : c.methods) {
        csv += "\"" + scene.scene + "\",\"" + c.condition.name + "\",\"" + m.method + "\"" +
               formatted(",%d,%d", m.answers, m.failures);
        for (const double v : {m.position.value, m.position.low, m.position.high, m.p90,
                               m.rmse.value, m.rmse.low, m.rmse.high}) {
          csv += cell(v);
        }
        for (const char* unknown : kUnknowns) {
          const auto at = std::ranges::find(scene.unknowns, unknown) - scene.unknowns.begin();
          const auto i = static_cast<std::size_t>(at);
          csv += i < m.mean_absolute.size() ? cell(m.mean_absolute[i]) : ",";
        }
        csv += m.claim ? cell(m.claim->share) + cell(m.claim->interval.low) +
                             cell(m.claim->interval.high)
                       : ",,,";
        csv += cell(1e3 * m.time);
        const auto& d = m.against_first;
        csv += (d ? cell(d->value) + cell(d->low) + cell(d->high) : ",,,") + "\n";
      }
    }
  }
  return csv;
}

nlohmann::ordered_json comparison_json(const ComparisonReport& report) {
  Json json;
  json["format"] = "blindcorner.comparison/1";
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
                              : "<p>What was trained, for the first of the splits:</p>\n") +
            methods_html(scene) + "<p>The conditions:</p>\n" + conditions_html(scene);
    if (s < report.pictures.size()) body += pictures_html(report.pictures[s]);
  }
  return plain_page("Methods compared", comparison_headline(report), body);
}

}  // namespace blindcorner
