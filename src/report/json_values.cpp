// SPDX-License-Identifier: Apache-2.0
#include "report/json_values.h"

#include <cstdlib>

#include "report/formatted.h"

namespace blindcorner {

nlohmann::json matrix_json(const Eigen::MatrixXd& values) {
  nlohmann::json rows = nlohmann::json::array();
  for (Eigen::Index i = 0; i < values.rows(); ++i) {
    const Eigen::VectorXd row = values.row(i);
    rows.push_back(numbers_json(row));
  }
  return rows;
}

double with_digits(double value, int digits) {
  return std::strtod(formatted("%.*g", digits, value).c_str(), nullptr);
}

}  // namespace blindcorner
