// SPDX-License-Identifier: Apache-2.0
#include "inverse/search/spline_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace blindcorner {
namespace {

using Function = std::function<double(const PoseVector&)>;

/// Rows that are multiples of f, so that mixed-up rows show.
Eigen::MatrixXf tabulate(const std::vector<GridAxis>& axes, const Function& f, int rows) {
  Eigen::Index count = 1;
  for (const GridAxis& axis : axes) count *= axis.count;
  Eigen::MatrixXf values(rows, count);
  for (Eigen::Index index = 0; index < count; ++index) {
    PoseVector pose(static_cast<Eigen::Index>(axes.size()));
    Eigen::Index rest = index;
    for (std::size_t d = axes.size(); d-- > 0;) {
      pose[static_cast<Eigen::Index>(d)] =
          axes[d].first + static_cast<double>(rest % axes[d].count) * axes[d].spacing;
      rest /= axes[d].count;
    }
    for (int r = 0; r < rows; ++r) {
      values(r, index) = static_cast<float>((r + 1) * f(pose));
    }
  }
  return values;
}

/// Largest error over random poses inside of the grid, relative to the largest value.
double largest_error(const std::vector<GridAxis>& axes, const Function& f) {
  constexpr int kRows = 5;
  const SplineGrid grid(tabulate(axes, f, kRows), axes);
  std::mt19937 random(3);
  double error = 0;
  double largest = 0;
  std::vector<double> out(kRows);
  for (int i = 0; i < 400; ++i) {
    PoseVector pose(static_cast<Eigen::Index>(axes.size()));
    for (std::size_t d = 0; d < axes.size(); ++d) {
      const int steps = axes[d].periodic ? axes[d].count : axes[d].count - 1;
      std::uniform_real_distribution<double> along(axes[d].first,
                                                   axes[d].first + steps * axes[d].spacing);
      pose[static_cast<Eigen::Index>(d)] = along(random);
    }
    grid.evaluate(pose, out.data());
    for (int r = 0; r < kRows; ++r) {
      const double expected = (r + 1) * f(pose);
      error = std::max(error, std::abs(out[static_cast<std::size_t>(r)] - expected));
      largest = std::max(largest, expected);
    }
  }
  return error / largest;
}

// Not-a-knot splines reproduce cubics, up to the end points; float coefficients limit the rest.
TEST(SplineGrid, CubicsAreExact) {
  const std::vector<GridAxis> axes{{-1.0, 0.4, 6, false}, {2.0, 0.3, 7, false}};
  const auto cubic = [](const PoseVector& p) {
    const double x = p[0];
    const double y = p[1] - 3;
    return 20 + x * x * x - 2 * x * y * y + 0.5 * y * y * y + x;
  };
  EXPECT_LT(largest_error(axes, cubic), 3e-6);
}

// h^4 / (128 s^4) for a Gaussian: 0.25 % at h = 0.75 s and 16 times less at half of that.
TEST(SplineGrid, ErrorOfAGaussianIsAsDerived) {
  const auto gaussian = [](const PoseVector& p) { return std::exp(-0.5 * p[0] * p[0]); };
  const double coarse = largest_error({{-6, 0.75, 17, false}}, gaussian);
  const double fine = largest_error({{-6, 0.375, 33, false}}, gaussian);
  EXPECT_NEAR(coarse, std::pow(0.75, 4) / 128, 0.25 * coarse);
  EXPECT_NEAR(coarse / fine, 16, 4);
}

TEST(SplineGrid, PeriodicAxisHasNoSeam) {
  const double turn = 2 * std::numbers::pi;
  const std::vector<GridAxis> axes{{0.3, turn / 12, 12, true}, {0.0, 0.5, 4, false}};
  const auto wave = [](const PoseVector& p) { return 2 + std::cos(p[0]) + 0.1 * p[1]; };
  EXPECT_LT(largest_error(axes, wave), 1e-3);
  const SplineGrid grid(tabulate(axes, wave, 1), axes);
  double below = 0;
  double above = 0;
  grid.evaluate(Eigen::Vector2d(0.3 - 1e-6, 1), &below);
  grid.evaluate(Eigen::Vector2d(0.3 + turn - 1e-6, 1), &above);
  EXPECT_NEAR(below, above, 1e-6);
  EXPECT_NEAR(below, wave(Eigen::Vector2d(0.3, 1)), 1e-3);
}

TEST(SplineGrid, ShortAxesAreConstantOrLinear) {
  const auto plane = [](const PoseVector& p) { return 5 + p[0] + 2 * p[1] * 0 + p[2]; };
  EXPECT_LT(largest_error({{0, 1, 2, false}, {4, 1, 1, false}, {0, 0.5, 5, false}}, plane), 1e-6);
}

// Expected counts are never negative, and what is dark stays exactly dark.
TEST(SplineGrid, RipplesAreCut) {
  const std::vector<GridAxis> axes{{0, 1, 20, false}};
  const auto step = [](const PoseVector& p) { return p[0] > 9.5 ? 1.0 : 0.0; };
  const SplineGrid grid(tabulate(axes, step, 2), axes);
  std::vector<double> out(2);
  for (double x = 0; x <= 19; x += 0.01) {
    grid.evaluate(Eigen::VectorXd::Constant(1, x), out.data());
    EXPECT_GE(out[0], 0);
  }
  grid.evaluate(Eigen::VectorXd::Constant(1, 1.5), out.data());
  EXPECT_LT(out[0], 1e-3);
}

}  // namespace
}  // namespace blindcorner
