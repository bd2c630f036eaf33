// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/credible_level.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "blindcorner/forward/error.h"

namespace blindcorner {

double credible_level(const Scene& scene, const PoseMixture& mixture, const PoseVector& truth,
                      int samples, std::uint64_t seed) {
  std::vector<Eigen::LLT<Eigen::MatrixXd>> factors;
  std::vector<double> weights, scales;
  for (const PoseMode& mode : mixture.modes) {
    factors.emplace_back(mode.covariance);
    weights.push_back(mode.weight);
    scales.push_back(mode.weight / factors.back().matrixLLT().diagonal().prod());
  }
  const auto density = [&](const PoseVector& pose) {
    double sum = 0;
    for (std::size_t i = 0; i < factors.size(); ++i) {
      const PoseVector d = pose_error(scene, pose, mixture.modes[i].pose);
      sum += scales[i] * std::exp(-0.5 * factors[i].matrixL().solve(d).squaredNorm());
    }
    return sum;
  };
  const double at_truth = density(truth);
  std::mt19937_64 random(seed);
  std::discrete_distribution<std::size_t> pick(weights.begin(), weights.end());
  std::normal_distribution<double> normal;
  int denser = 0;
  for (int s = 0; s < samples; ++s) {
    const std::size_t i = pick(random);
    PoseVector u(truth.size());
    for (double& value : u) value = normal(random);
    denser += density(mixture.modes[i].pose + factors[i].matrixL() * u) > at_truth ? 1 : 0;
  }
  return static_cast<double>(denser) / samples;
}

namespace {

constexpr double kZ = 1.959964;  // of the normal distribution, 95 % within

}  // namespace

MeanInterval mean_interval(std::span<const double> values) {
  if (values.size() < 2) {
    throw Error("mean_interval", std::to_string(values.size()) + " values; accepted: 2 or more");
  }
  const auto n = static_cast<double>(values.size());
  double sum = 0, squares = 0;
  for (const double value : values) sum += value;
  const double mean = sum / n;
  for (const double value : values) squares += (value - mean) * (value - mean);
  const double quantile = boost::math::quantile(boost::math::students_t(n - 1), 0.975);
  const double half = quantile * std::sqrt(squares / (n - 1) / n);
  return {mean, mean - half, mean + half};
}

ShareInterval wilson_interval(int successes, int trials) {
  if (trials <= 0) return {};
  const double n = trials;
  const double share = successes / n;
  const double scale = 1 / (1 + kZ * kZ / n);
  const double center = scale * (share + kZ * kZ / (2 * n));
  const double half = scale * kZ * std::sqrt(share * (1 - share) / n + kZ * kZ / (4 * n * n));
  // Rounding must not lead beyond what shares can be.
  return {std::max(0.0, center - half), std::min(1.0, center + half)};
}

}  // namespace blindcorner
