// SPDX-License-Identifier: Apache-2.0
/// Figures of merit of many estimates, for the eye.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/inverse/posterior/evaluation.h"

namespace blindcorner {

/// One row of the table.
struct EvaluationRow {
  std::string name;
  std::vector<EstimateError> errors;
  Evaluation evaluation;
};

/// Table for a terminal: a row each, figures with their intervals.
std::string evaluation_text(const std::vector<EvaluationRow>& rows);

/// Table with pictures: distribution of the errors, and claimed against actual errors.
std::string evaluation_page(const std::string& title, const std::vector<EvaluationRow>& rows,
                            const std::vector<std::string>& names);

/// The figures as JSON text.
std::string evaluation_json(const std::vector<EvaluationRow>& rows);

}  // namespace blindcorner
