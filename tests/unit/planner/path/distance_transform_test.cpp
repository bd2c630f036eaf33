// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/distance_transform.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

constexpr double kNoCell = std::numeric_limits<double>::infinity();

TEST(DistanceTransform, SquaresAreAsFarAsTheirNearestPoint) {
  std::mt19937_64 random(1);
  for (const double share : {0.01, 0.1, 0.6}) {
    const GridGeometry grid{.columns = 23, .rows = 17};
    std::vector<std::uint8_t> obstacle(grid.cells());
    std::bernoulli_distribution occupied(share);
    for (auto& o : obstacle) o = occupied(random) ? 1 : 0;
    const std::vector<double> found = squared_distances(grid, obstacle);
    for (std::size_t i = 0; i < grid.cells(); ++i) {
      double least = kNoCell;
      for (std::size_t k = 0; k < grid.cells(); ++k) {
        if (obstacle[k] == 0) continue;
        const Cell a = grid.cell(i), b = grid.cell(k);
        const double x = std::max(0.0, std::abs(a.column - b.column) - 0.5);
        const double y = std::max(0.0, std::abs(a.row - b.row) - 0.5);
        least = std::min(least, x * x + y * y);
      }
      ASSERT_EQ(found[i], least) << "cell " << i;  // quarters are exact in binary
    }
  }
}

TEST(DistanceTransform, ParabolasLowerAFunctionToTheirEnvelope) {
  std::mt19937_64 random(2);
  const GridGeometry grid{.columns = 14, .rows = 19};
  std::uniform_real_distribution<double> height(-50, 50);
  std::vector<double> f(grid.cells());
  for (std::size_t i = 0; i < f.size(); ++i) f[i] = i % 3 == 0 ? kNoCell : height(random);
  const std::vector<double> found = lowered_by_parabolas(grid, f);
  for (std::size_t i = 0; i < f.size(); ++i) {
    double least = kNoCell;
    for (std::size_t k = 0; k < f.size(); ++k) {
      const Cell a = grid.cell(i), b = grid.cell(k);
      least = std::min(least, f[k] + std::pow(a.column - b.column, 2) + std::pow(a.row - b.row, 2));
    }
    ASSERT_NEAR(found[i], least, 1e-10) << "cell " << i;  // rounding of sums below 1000
  }
}

TEST(DistanceTransform, WithoutObstaclesDistancesAreInfinite) {
  const GridGeometry grid{.columns = 3, .rows = 2};
  for (const double d : squared_distances(grid, std::vector<std::uint8_t>(6, 0))) {
    EXPECT_EQ(d, kNoCell);
  }
}

TEST(DistanceTransform, RefusesAnotherNumberOfValues) {
  const GridGeometry grid{.columns = 3, .rows = 2};
  EXPECT_THROW(squared_distances(grid, std::vector<std::uint8_t>(5, 0)), Error);
}

}  // namespace
}  // namespace blindcorner
