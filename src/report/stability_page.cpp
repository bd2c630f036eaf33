// SPDX-License-Identifier: Apache-2.0
#include "report/stability_page.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "report/formatted.h"
#include "report/html.h"
#include "report/json_values.h"

namespace blindcorner {
namespace {

const char* const kStyle =
    "<style>td,th{text-align:left;white-space:normal}"
    "td.number{text-align:right;white-space:nowrap}td:first-child{white-space:nowrap}"
    "td:nth-child(2),td:nth-child(5){min-width:220px}"
    ".margin{display:grid;grid-template-columns:fit-content(340px) 90px minmax(90px,1fr);"
    "gap:2px 12px;align-items:center;font-size:13px;max-width:1000px;margin-bottom:1.5em}"
    ".margin>div:nth-child(3n+2){text-align:right;font-variant-numeric:tabular-nums}"
    ".track{position:relative;height:12px;border-radius:3px;background:linear-gradient(90deg,"
    "var(--shade) 80%,var(--alarm) 80%)}"
    ".track::after{content:'';position:absolute;left:80%;top:-2px;bottom:-2px;width:2px;"
    "background:var(--line)}"
    ".mark{position:absolute;top:1px;width:10px;height:10px;margin-left:-5px;border-radius:5px;"
    "background:var(--good)}.mark.over{background:var(--bad)}"
    "@media(max-width:640px){.margin{grid-template-columns:minmax(0,1fr) 90px}"
    ".track{grid-column:1/-1}}"
    ".fails{background:var(--alarm);font-weight:600}.why{color:var(--soft);font-size:13px}</"
    "style>\n";

/// Three digits. Adding 0.0 removes the sign of a negative zero.
std::string number(double value) { return formatted("%.3g", value + 0.0); }

std::string with_unit(double value, const std::string& unit) {
  return number(value) + (unit == "1" ? "" : " " + html_safe(unit));
}

/// The scale of the picture in shares of the limit: logarithmic, the limit at four fifths.
constexpr double kLeast = 1e-4, kMost = 10, kLimitAt = 80;  // the last in per cent of the width

/// Place of a share in per cent of the width. A share of 0 or less stands at the left end, one that
/// is not finite at the right.
double place_of(double share) {
  if (!std::isfinite(share) || share >= kMost) return 99;
  if (share <= kLeast) return 1;
  return share > 1 ? kLimitAt + (99 - kLimitAt) * std::log(share) / std::log(kMost)
                   : 1 + (kLimitAt - 1) * std::log(share / kLeast) / std::log(1 / kLeast);
}

/// What was measured, as a share of its limit. A limit of 0 has no shares: 0 if it holds, else
/// infinity.
double share_of(const StabilityResult& result) {
  const double measured = result.measured.value, limit = result.row->limit;
  if (limit > 0) return measured / limit;
  return result.holds ? 0 : std::numeric_limits<double>::infinity();
}

std::string share_text(const StabilityResult& result) {
  const double share = share_of(result);
  if (!(result.row->limit > 0)) return result.holds ? "at limit 0" : "over limit 0";
  if (!std::isfinite(share)) return "no value";
  if (share > 0 && share < 1e-4) return "< 0.01 %";
  return formatted("%.3g %%", 100 * share + 0.0);
}

/// A line for each case: how near to its limit it comes.
std::string margins_html(const std::vector<StabilityResult>& results) {
  std::string html =
      "<p>How much of its limit each case uses, in per cent, on a logarithmic scale from 0.01 % "
      "on: the line is the limit, what lies beyond it fails.</p>\n<div class=\"margin\">\n";
  for (const StabilityResult& result : results) {
    html += "<div>" + html_safe(result.row->name) + "</div><div>" + html_safe(share_text(result)) +
            "</div><div class=\"track\" title=\"" + html_safe(result.row->action) + "\">" +
            formatted("<div class=\"mark%s\" style=\"left:%.1f%%\"></div></div>\n",
                      result.holds ? "" : " over", place_of(share_of(result)));
  }
  return html + "</div>\n";
}

std::string row_html(const StabilityResult& result) {
  const StabilityRow& row = *result.row;
  std::string html = result.holds ? "<tr>" : "<tr class=\"fails\">";
  html += "<td>" + html_safe(row.name) + "</td><td>" + html_safe(row.action);
  if (!result.measured.detail.empty()) {
    html += "<div class=\"why\">" + html_safe(result.measured.detail) + "</div>";
  }
  html += "</td><td class=\"number\">" + with_unit(result.measured.value, row.unit) +
          "</td><td class=\"number\">" + with_unit(row.limit, row.unit) + "</td><td>" +
          limit_origin_name(row.origin) + "<div class=\"why\">" + html_safe(row.reason) +
          "</div></td><td>" + (result.holds ? "holds" : "fails") + "</td></tr>\n";
  return html;
}

}  // namespace

std::string stability_json(const std::vector<StabilityResult>& results) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  bool all = true;
  for (const StabilityResult& result : results) {
    const StabilityRow& row = *result.row;
    all = all && result.holds;
    rows.push_back({{"name", row.name},
                    {"theme", row.theme},
                    {"action", row.action},
                    {"measured", number_or_null(result.measured.value)},
                    {"limit", row.limit},
                    {"unit", row.unit},
                    {"origin", limit_origin_name(row.origin)},
                    {"reason", row.reason},
                    {"detail", result.measured.detail},
                    {"verdict", result.holds ? "holds" : "fails"},
                    {"cpu_s", result.seconds}});
  }
  const nlohmann::ordered_json document{
      {"format", "blindcorner.stability/1"}, {"holds", all}, {"rows", std::move(rows)}};
  return document.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string stability_page(const std::vector<StabilityResult>& results) {
  const auto holding = std::ranges::count_if(results, &StabilityResult::holds);
  std::string body =
      kStyle + margins_html(results) +
      formatted(
          "<p>A case holds where what was measured is "
          "at most the limit. Limits from physics are laws that light or motion obeys; limits "
          "from arithmetic are what rounding or a stated approximation may cost.</p>\n");
  std::string theme;
  for (const StabilityResult& result : results) {
    if (result.row->theme != theme) {
      if (!theme.empty()) body += "</table>\n";
      theme = result.row->theme;
      body += "<h2>" + html_safe(theme) +
              "</h2>\n<table><tr><th>case</th><th>what is done and measured</th>"
              "<th>measured</th><th>limit</th><th>limit from</th><th>verdict</th></tr>\n";
    }
    body += row_html(result);
  }
  if (!theme.empty()) body += "</table>\n";
  return plain_page("Stiff and extreme cases",
                    formatted("%d of %d stiff and extreme cases hold.", static_cast<int>(holding),
                              static_cast<int>(results.size())),
                    body);
}

}  // namespace blindcorner
