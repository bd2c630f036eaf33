// SPDX-License-Identifier: Apache-2.0
#include "report/claim_table.h"

#include "report/formatted.h"
#include "report/html.h"

namespace blindcorner {

const char* const kJudgedTogether =
    "equal tails of the binomial distribution, of a mean square those of chi-square, at a "
    "confidence (Bonferroni's) with which all rows of this page together hold in 95 of 100 such "
    "studies if all claims are true.";

std::string verdict_row(bool holds) {
  return holds ? "<tr>" : "<tr style=\"background:var(--alarm);font-weight:600\">";
}

std::string claim_table_html(std::span<const ClaimTest> claims) {
  std::string html =
      "<table><tr><th>claim<th>trials<th>claimed<th>found<th>allowed"
      "<th>verdict</tr>\n";
  for (const ClaimTest& c : claims) {
    html += verdict_row(c.holds) + "<td>" + html_safe(c.what) +
            formatted("<td>%d<td>%.3f<td>%.4f<td>%.4f to %.4f<td>%s</tr>\n", c.trials, c.claimed,
                      c.found, c.low, c.high, c.holds ? "holds" : "fails");
  }
  return html + "</table>\n";
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

nlohmann::ordered_json claims_json(std::span<const ClaimTest> claims) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const ClaimTest& c : claims) {
    json.push_back({{"claim", c.what},
                    {"trials", c.trials},
                    {"claimed", c.claimed},
                    {"found", c.found},
                    {"allowed_low", c.low},
                    {"allowed_high", c.high},
                    {"holds", c.holds}});
  }
  return json;
}

std::string photons_csv(const ClaimLevel& level) {
  return level.photons ? formatted("%g", *level.photons) : std::string();
}

std::string claim_rows_csv(const Scene& scene, const ClaimLevel& level) {
  std::string csv;
  for (const ClaimTest& c : level.claims) {
    csv += "\"" + scene.name + "\"," + photons_csv(level) + ",\"" + c.what + "\"" +
           formatted(",%d,%.6g,%.6g,%.6g,%.6g,%d\n", c.trials, c.claimed, c.found, c.low, c.high,
                     c.holds ? 1 : 0);
  }
  return csv;
}

nlohmann::ordered_json study_json(const std::string& format, const ClaimStudyOptions& options,
                                  const std::string& headline) {
  return {{"format", format},
          {"captures", options.captures},
          {"seed", options.seed},
          {"true_light", options.light == TrueLight::reference ? "reference" : "sensor"},
          {"headline", headline}};
}

nlohmann::ordered_json level_json(const ClaimLevel& level) {
  using Json = nlohmann::ordered_json;
  return {{"photons", level.photons ? Json(*level.photons) : Json(nullptr)},
          {"exposures", level.exposure.exposures},
          {"ambient_counts_per_bin", level.exposure.ambient},
          {"failures", level.failures}};
}

}  // namespace blindcorner
