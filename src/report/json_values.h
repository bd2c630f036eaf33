// SPDX-License-Identifier: Apache-2.0
/// Numbers, vectors and matrices as JSON. What is not finite becomes null.
#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "blindcorner/report/result_file.h"

namespace blindcorner {

template <typename Numbers>
nlohmann::json numbers_json(const Numbers& values) {
  nlohmann::json list = nlohmann::json::array();
  for (const double value : values) list.push_back(number_or_null(value));
  return list;
}

/// A list of rows.
nlohmann::json matrix_json(const Eigen::MatrixXd& values);

/// The number with so many significant digits.
double with_digits(double value, int digits);

}  // namespace blindcorner
