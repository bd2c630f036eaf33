// SPDX-License-Identifier: Apache-2.0
#include "inverse/search/spline_grid.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "forward/support/multiversion.h"
#include "forward/support/parallel.h"

namespace blindcorner {
namespace {

/// Values below this share of the largest one are taken as zero. They are the spline's ripples
/// beside the light. These fall by 2 - sqrt(3) = 0.27 from point to point, and to this share within
/// seven points.
constexpr float kRipple = 1e-4F;

/// From values to B-spline coefficients along one axis, [coefficients, points].
Eigen::MatrixXf coefficient_matrix(const GridAxis& axis) {
  const int n = axis.count;
  if (axis.periodic) {
    Eigen::MatrixXd spline = Eigen::MatrixXd::Zero(n, n);
    for (int i = 0; i < n; ++i) {
      spline(i, (i + n - 1) % n) += 1.0 / 6;
      spline(i, i) += 4.0 / 6;
      spline(i, (i + 1) % n) += 1.0 / 6;
    }
    return spline.inverse().cast<float>();
  }
  if (n < 4) return Eigen::MatrixXf::Identity(n, n);
  // n interpolation conditions and, at either end, a third derivative without a jump.
  Eigen::MatrixXd spline = Eigen::MatrixXd::Zero(n + 2, n + 2);
  for (int i = 0; i < n; ++i) spline.block(i, i, 1, 3) << 1.0 / 6, 4.0 / 6, 1.0 / 6;
  spline.block(n, 0, 1, 5) << 1, -4, 6, -4, 1;
  spline.block(n + 1, n - 3, 1, 5) << 1, -4, 6, -4, 1;
  return spline.inverse().leftCols(n).cast<float>();
}

/// Coefficients that a point depends on, with their weights. They are consecutive (modulo the size
/// when periodic).
struct Support {
  std::array<int, 4> index{};
  std::array<float, 4> weight{};
  int count = 1;
};

Support support(const GridAxis& axis, int size, double value) {
  Support s;
  if (axis.count == 1) {
    s.weight[0] = 1;
    return s;
  }
  const double x = (value - axis.first) / axis.spacing;
  if (!axis.periodic && axis.count < 4) {  // linear
    const int i = std::clamp(static_cast<int>(std::floor(x)), 0, axis.count - 2);
    const auto t = static_cast<float>(x - i);
    s.index = {i, i + 1};
    s.weight = {1 - t, t};
    s.count = 2;
    return s;
  }
  int i = static_cast<int>(std::floor(x));
  if (!axis.periodic) i = std::clamp(i, 0, axis.count - 2);
  const auto t = static_cast<float>(x - i);
  const float u = 1 - t;
  s.weight = {u * u * u / 6, (4 - 6 * t * t + 3 * t * t * t) / 6,
              (4 - 6 * u * u + 3 * u * u * u) / 6, t * t * t / 6};
  s.count = 4;
  for (int k = 0; k < 4; ++k) {
    const int at = axis.periodic ? ((i + k - 1) % size + size) % size : i + k;
    s.index[static_cast<std::size_t>(k)] = at;
  }
  return s;
}

BLINDCORNER_MULTIVERSION void add_columns(const float* a, const float* b, const float* c,
                                          const float* d, const std::array<float, 4>& weight,
                                          float scale, int rows, float* __restrict out) {
  const float wa = scale * weight[0], wb = scale * weight[1];
  const float wc = scale * weight[2], wd = scale * weight[3];
  BLINDCORNER_INDEPENDENT
  for (int r = 0; r < rows; ++r) out[r] += wa * a[r] + wb * b[r] + wc * c[r] + wd * d[r];
}

}  // namespace

SplineGrid::SplineGrid(const Eigen::MatrixXf& values, std::vector<GridAxis> axes)
    : axes_(std::move(axes)), coefficients_(values) {
  for (const GridAxis& axis : axes_) sizes_.push_back(axis.count);
  for (std::size_t d = 0; d < axes_.size(); ++d) {
    const Eigen::MatrixXf matrix = coefficient_matrix(axes_[d]);
    Eigen::Index outer = 1;
    Eigen::Index inner = 1;
    for (std::size_t k = 0; k < d; ++k) outer *= sizes_[k];
    for (std::size_t k = d + 1; k < axes_.size(); ++k) inner *= sizes_[k];
    const Eigen::Index from = sizes_[d];
    const Eigen::Index to = matrix.rows();
    Eigen::MatrixXf next(coefficients_.rows(), outer * to * inner);
    parallel_for(Eigen::Index{0}, outer * inner, [&](Eigen::Index line) {
      const Eigen::Index o = line / inner;
      const Eigen::Index i = line % inner;
      Eigen::MatrixXf points(coefficients_.rows(), from);
      for (Eigen::Index k = 0; k < from; ++k) {
        points.col(k) = coefficients_.col((o * from + k) * inner + i);
      }
      const Eigen::MatrixXf solved = points * matrix.transpose();
      for (Eigen::Index k = 0; k < to; ++k) next.col((o * to + k) * inner + i) = solved.col(k);
    });
    coefficients_ = std::move(next);
    sizes_[d] = static_cast<int>(to);
  }
}

void SplineGrid::evaluate(const PoseVector& pose, double* out) const {
  const int rows = static_cast<int>(coefficients_.rows());
  thread_local std::vector<float> sum;
  sum.assign(static_cast<std::size_t>(rows), 0.0F);
  std::vector<Support> supports;
  for (std::size_t d = 0; d < axes_.size(); ++d) {
    supports.push_back(support(axes_[d], sizes_[d], pose[static_cast<Eigen::Index>(d)]));
  }
  // All combinations of coefficients along the axes but the last, which is taken four at a time.
  const Support& last = supports.back();
  std::vector<int> at(axes_.size(), 0);
  while (true) {
    Eigen::Index column = 0;
    float weight = 1;
    for (std::size_t d = 0; d + 1 < axes_.size(); ++d) {
      const auto k = static_cast<std::size_t>(at[d]);
      column = column * sizes_[d] + supports[d].index[k];
      weight *= supports[d].weight[k];
    }
    column *= sizes_.back();
    const float* first = coefficients_.data();
    const auto data = [&](std::size_t k) {  // unused ones have no weight
      return first + (column + last.index[k]) * rows;
    };
    add_columns(data(0), data(1), data(2), data(3), last.weight, weight, rows, sum.data());
    std::size_t d = axes_.size() - 1;
    while (d > 0 && ++at[d - 1] == supports[d - 1].count) at[--d] = 0;
    if (d == 0) break;
  }
  const float largest = *std::max_element(sum.begin(), sum.end());
  for (int r = 0; r < rows; ++r) {
    const float value = sum[static_cast<std::size_t>(r)];
    out[r] = value > kRipple * largest ? static_cast<double>(value) : 0.0;
  }
}

}  // namespace blindcorner
