// SPDX-License-Identifier: Apache-2.0
/// Figures of merit of many estimates, as text, page and JSON.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/inverse/posterior/evaluation.h"

namespace blindcorner {

/// One row of the table.
struct EvaluationRow {
  std::string name;
  std::vector<EstimateError> errors{};
  /// Distances of the heaviest modes from the truth, m, which the pages of fits state. Empty: not
  /// known.
  std::vector<double> mode_distances{};
  std::string estimator{};  ///< whose errors the figures are; empty: left unsaid
  Evaluation evaluation{};
};

/// Table for a terminal: a line for each row, with the figures and their intervals.
std::string evaluation_text(const std::vector<EvaluationRow>& rows);

/// Table with pictures: distribution of the errors, and claimed against actual errors.
std::string evaluation_page(const std::string& title, const std::vector<EvaluationRow>& rows,
                            const std::vector<std::string>& names);

/// The figures as JSON text.
std::string evaluation_json(const std::vector<EvaluationRow>& rows);

}  // namespace blindcorner
