// SPDX-License-Identifier: Apache-2.0
#include "report/claim_table.h"

namespace blindcorner {

const char* const kJudgedTogether =
    "equal tails of the binomial distribution, of a mean square those of chi-square, at a "
    "confidence (Bonferroni's) with which all rows of this page together hold in 95 of 100 such "
    "studies if all claims are true.";

std::vector<TableRow> claim_rows(const Scene& scene, const ClaimLevel& level) {
  std::vector<TableRow> rows;
  for (const ClaimTest& c : level.claims) {
    rows.push_back({{{"scene", "", "", scene.name},
                     {"photons", "", "", photons_cell(level)},
                     {"claim", "claim", "%-34s", c.what},
                     {"trials", "trials", "%7d", c.trials},
                     {"claimed", "claimed", "%8.4f", c.claimed},
                     {"found", "found", "%8.4f", c.found},
                     {"allowed_low", "allowed from", "%8.4f", c.low},
                     {"allowed_high", "to", "%8.4f", c.high},
                     {"holds", "", "", c.holds},
                     {"", "verdict", "%8s", c.holds ? "holds" : "FAILS"}},
                    !c.holds});
  }
  return rows;
}

TableCell photons_cell(const ClaimLevel& level) {
  return level.photons ? TableCell(*level.photons) : TableCell(nullptr);
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
  using nlohmann::ordered_json;
  return {{"photons", level.photons ? ordered_json(*level.photons) : ordered_json(nullptr)},
          {"exposures", level.exposure.exposures},
          {"ambient_counts_per_bin", level.exposure.ambient},
          {"failures", level.failures}};
}

}  // namespace blindcorner
