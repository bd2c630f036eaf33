// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/gauss_legendre.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>

namespace blindcorner {
namespace {

std::vector<QuadraturePoint> make_rule(int count) {
  Eigen::VectorXd side(std::max(count - 1, 0));
  for (int k = 1; k < count; ++k) side[k - 1] = k / std::sqrt(4.0 * k * k - 1);
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver;
  solver.computeFromTridiagonal(Eigen::VectorXd::Zero(count), side);
  std::vector<QuadraturePoint> rule;
  double end = -1;
  for (int i = 0; i < count; ++i) {
    const double weight = 2 * std::pow(solver.eigenvectors()(0, i), 2);
    rule.push_back({solver.eigenvalues()[i], weight, end, end + weight});
    end += weight;
  }
  return rule;
}

}  // namespace

const std::vector<QuadraturePoint>& gauss_legendre(int count) {
  static std::mutex mutex;
  static std::map<int, std::vector<QuadraturePoint>> rules;
  const std::scoped_lock lock(mutex);
  const auto known = rules.find(count);
  return known != rules.end() ? known->second
                              : rules.emplace(count, make_rule(count)).first->second;
}

}  // namespace blindcorner
