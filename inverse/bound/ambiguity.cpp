// SPDX-License-Identifier: Apache-2.0
#include "inverse/bound/ambiguity.h"

#include <algorithm>
#include <cmath>

namespace blindcorner {

Eigen::MatrixXd ambiguity_bound(const Eigen::MatrixXd& points, const Eigen::VectorXd& weights,
                                const Eigen::MatrixXd& roots) {
  const Eigen::MatrixXd products = roots.transpose() * roots;
  Eigen::MatrixXd bound = Eigen::MatrixXd::Zero(points.rows(), points.rows());
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      const double distance =
          std::max(products(i, i) + products(j, j) - 2 * products(i, j), 0.0);  // squared
      const Eigen::VectorXd d = points.col(i) - points.col(j);
      bound += weights[i] * weights[j] * std::exp(-distance) * d * d.transpose();
    }
  }
  return bound;
}

}  // namespace blindcorner
