// SPDX-License-Identifier: Apache-2.0
#include "inverse/likelihood/local_model.h"

#include <Eigen/QR>
#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "inverse/search/compiled_scene.h"

namespace blindcorner {
namespace {

/// Highest degree. By judgement: degree 5 with three unknowns would take 92 nodes.
constexpr int kMaxDegree = 4;
/// Lower limit of one minus a node's leverage. With it, a node that nearly determines itself says
/// nothing about the error, rather than everything.
constexpr double kMinLeft = 1e-3;

/// Weight of a node's equations at |z| standard deviations. It falls more slowly than a round
/// posterior, so that the outer nodes still hold the polynomial.
double fit_weight(double z) { return std::exp(-z * z / 8); }

std::size_t nodes_for(std::size_t terms) {
  return static_cast<std::size_t>(std::ceil(1.6 * static_cast<double>(terms))) + 2;
}

Eigen::VectorXd coordinates(const Scene& scene, const LocalRegion& region, const PoseVector& pose) {
  return region.root.triangularView<Eigen::Lower>().solve(
      pose_difference(scene, region.center, pose));
}

/// Values of the monomials. `z` is scaled by the reach, so that all columns of a design are of one
/// size.
Eigen::VectorXd monomials(const std::vector<std::vector<int>>& exponents,
                          const Eigen::VectorXd& z) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(exponents.size()));
  for (std::size_t k = 0; k < exponents.size(); ++k) {
    double product = 1;
    for (Eigen::Index i = 0; i < z.size(); ++i) {
      for (int p = 0; p < exponents[k][static_cast<std::size_t>(i)]; ++p) {
        product *= z[i];
      }
    }
    out[static_cast<Eigen::Index>(k)] = product;
  }
  return out;
}

}  // namespace

double local_reach(Eigen::Index unknowns) {
  constexpr double kBeyond = 1e-3;
  return std::sqrt(2 * boost::math::gamma_q_inv(0.5 * static_cast<double>(unknowns), kBeyond));
}

double leave_one_out_error(const Eigen::MatrixXd& design, const Eigen::VectorXd& weight,
                           const Eigen::MatrixXd& gram) {
  const Eigen::Index count = weight.size();
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(weight.asDiagonal() * design);
  const Eigen::MatrixXd q = qr.householderQ() * Eigen::MatrixXd::Identity(count, qr.rank());
  const Eigen::MatrixXd rest = Eigen::MatrixXd::Identity(count, count) - q * q.transpose();
  const Eigen::MatrixXd light = weight.asDiagonal() * gram * weight.asDiagonal();
  const Eigen::VectorXd squares = (rest * light).cwiseProduct(rest).rowwise().sum();
  double sum = 0;
  for (Eigen::Index i = 0; i < count; ++i) {
    sum += 0.5 * squares[i] / std::pow(std::max(rest(i, i), kMinLeft), 2);
  }
  return sum / weight.squaredNorm();
}

std::optional<LocalModel> LocalModel::fit(const Scene& scene, LocalRegion region,
                                          const std::vector<LightNode>& nodes,
                                          const Eigen::VectorXd& row_information,
                                          double tolerance) {
  LocalModel model(std::move(region));
  std::vector<const LightNode*> inside;
  std::vector<Eigen::VectorXd> z;
  for (const LightNode& node : nodes) {
    if (inside.size() == kMaxNodes) break;
    Eigen::VectorXd at = coordinates(scene, model.region_, node.pose) / model.reach_;
    if (!(at.norm() <= 1)) continue;
    inside.push_back(&node);
    z.push_back(std::move(at));
  }
  std::vector<int> object_of;
  for (const Unknown& unknown : scene.unknowns) object_of.push_back(unknown.object);
  constexpr int kLeastDegree = 2;
  if (inside.size() < nodes_for(monomials_up_to(kLeastDegree, object_of).size())) {
    return std::nullopt;
  }

  const auto count = static_cast<Eigen::Index>(inside.size());
  Eigen::MatrixXd light(row_information.size(), count);
  Eigen::VectorXd weight(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    light.col(i) = inside[static_cast<std::size_t>(i)]->light;
    weight[i] = fit_weight(model.reach_ * z[static_cast<std::size_t>(i)].norm());
  }
  const Eigen::MatrixXd seen = row_information.cwiseSqrt().asDiagonal() * light;
  const Eigen::MatrixXd gram = seen.transpose() * seen;

  model.error_ = std::numeric_limits<double>::infinity();
  Eigen::MatrixXd chosen;
  for (int degree = kLeastDegree; degree <= kMaxDegree; ++degree) {
    auto exponents = monomials_up_to(degree, object_of);
    if (nodes_for(exponents.size()) > inside.size()) break;
    Eigen::MatrixXd design(count, static_cast<Eigen::Index>(exponents.size()));
    for (Eigen::Index i = 0; i < count; ++i) {
      design.row(i) = monomials(exponents, z[static_cast<std::size_t>(i)]).transpose();
    }
    const double error = leave_one_out_error(design, weight, gram);
    if (!(error < model.error_)) continue;
    model.error_ = error;
    model.degree_ = degree;
    model.exponents_ = std::move(exponents);
    chosen = std::move(design);
  }
  if (!(model.error_ <= tolerance)) return std::nullopt;
  // The coefficients are a linear function of the nodes' lights, [terms, nodes].
  const Eigen::MatrixXd equations = weight.asDiagonal();
  const Eigen::MatrixXd by_node =
      Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(equations * chosen).solve(equations);
  model.coefficients_ = light * by_node.transpose();
  return model;
}

bool LocalModel::covers(const Scene& scene, const PoseVector& pose) const {
  return coordinates(scene, region_, pose).norm() <= reach_;
}

void LocalModel::light(const Scene& scene, const PoseVector& pose, double* out) const {
  Eigen::Map<Eigen::VectorXd> rows(out, coefficients_.rows());
  rows.noalias() =
      coefficients_ * monomials(exponents_, coordinates(scene, region_, pose) / reach_);
  rows = rows.cwiseMax(0.0);
}

std::vector<std::vector<int>> monomials_up_to(int degree, const std::vector<int>& object_of) {
  std::vector<std::vector<int>> all;
  std::vector<int> exponents(object_of.size(), 0);
  const auto keep = [&] {
    bool mixed = false;
    int first = -1;
    for (std::size_t i = 0; i < exponents.size(); ++i) {
      if (exponents[i] == 0) continue;
      mixed = mixed || (first >= 0 && object_of[i] != first);
      first = object_of[i];
    }
    const int sum = std::accumulate(exponents.begin(), exponents.end(), 0);
    if (sum <= (mixed ? std::min(degree, 2) : degree)) all.push_back(exponents);
  };
  const auto next = [&](auto&& self, std::size_t i, int left) -> void {
    if (i == exponents.size()) {
      keep();
      return;
    }
    for (int e = 0; e <= left; ++e) {
      exponents[i] = e;
      self(self, i + 1, left - e);
    }
    exponents[i] = 0;
  };
  next(next, 0, degree);
  return all;
}

}  // namespace blindcorner
