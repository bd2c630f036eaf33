// SPDX-License-Identifier: Apache-2.0
#include "report/claim_table.h"

#include "report/formatted.h"
#include "report/html.h"

namespace blindcorner {

std::string claim_table_html(std::span<const ClaimTest> claims) {
  std::string html =
      "<div style=\"overflow-x:auto\"><table><tr><th>claim<th>trials<th>claimed<th>found<th>allowed"
      "<th>verdict</tr>\n";
  for (const ClaimTest& c : claims) {
    html += std::string(c.holds ? "<tr>" : "<tr style=\"background:#fde7e2;font-weight:600\">") +
            "<td>" + html_safe(c.what) +
            formatted("<td>%d<td>%.3f<td>%.4f<td>%.4f to %.4f<td>%s</tr>\n", c.trials, c.claimed,
                      c.found, c.low, c.high, c.holds ? "holds" : "fails");
  }
  return html + "</table></div>\n";
}

std::string claim_table_text(std::span<const ClaimTest> claims) {
  std::string text =
      formatted("  %-32s %7s %8s %8s  %-18s\n", "claim", "trials", "claimed", "found", "allowed");
  for (const ClaimTest& c : claims) {
    text += formatted("  %-32s %7d %8.4f %8.4f  %.4f to %.4f   %s\n", c.what.c_str(), c.trials,
                      c.claimed, c.found, c.low, c.high, c.holds ? "holds" : "FAILS");
  }
  return text;
}

std::string claim_csv_header() {
  return "claim,trials,claimed,found,allowed_low,allowed_high,holds";
}

std::string claim_csv(const ClaimTest& c) {
  return "\"" + c.what + "\"" +
         formatted(",%d,%.6g,%.6g,%.6g,%.6g,%d", c.trials, c.claimed, c.found, c.low, c.high,
                   c.holds ? 1 : 0);
}

nlohmann::ordered_json claim_json(const ClaimTest& c) {
  return {{"claim", c.what},  {"trials", c.trials},   {"claimed", c.claimed},
          {"found", c.found}, {"allowed_low", c.low}, {"allowed_high", c.high},
          {"holds", c.holds}};
}

}  // namespace blindcorner
