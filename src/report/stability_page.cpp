// SPDX-License-Identifier: Apache-2.0
#include "report/stability_page.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "report/formatted.h"
#include "report/html.h"
#include "report/json_values.h"

namespace blindcorner {
namespace {

const char* const kStyle =
    "<style>.wide{overflow-x:auto}.wide td,.wide "
    "th{text-align:left;vertical-align:top;white-space:normal}"
    ".wide td.number{text-align:right;white-space:nowrap}.wide td:first-child{white-space:nowrap}"
    ".wide td:nth-child(2),.wide td:nth-child(5){min-width:220px}"
    ".fails{background:var(--alarm);font-weight:600}.why{color:var(--soft);font-size:13px}</"
    "style>\n";

/// Without the sign of a negative zero.
std::string number(double value) { return formatted("%.3g", value + 0.0); }

std::string with_unit(double value, const std::string& unit) {
  return number(value) + (unit == "1" ? "" : " " + html_safe(unit));
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
      kStyle +
      formatted(
          "<p>A case holds where what was measured is "
          "at most the limit. Limits from physics are laws that light or motion obeys; limits "
          "from arithmetic are what rounding or a stated approximation may cost.</p>\n");
  std::string theme;
  for (const StabilityResult& result : results) {
    if (result.row->theme != theme) {
      if (!theme.empty()) body += "</table></div>\n";
      theme = result.row->theme;
      body +=
          "<h2>" + html_safe(theme) +
          "</h2>\n<div class=\"wide\"><table><tr><th>case</th><th>what is done and measured</th>"
          "<th>measured</th><th>limit</th><th>limit from</th><th>verdict</th></tr>\n";
    }
    body += row_html(result);
  }
  if (!theme.empty()) body += "</table></div>\n";
  return plain_page("Stiff and extreme cases",
                    formatted("%d of %d stiff and extreme cases hold.", static_cast<int>(holding),
                              static_cast<int>(results.size())),
                    body);
}

}  // namespace blindcorner
