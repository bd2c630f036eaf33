// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/gauss_legendre.h"

#include <gtest/gtest.h>

#include <cmath>

namespace blindcorner {
namespace {

TEST(GaussLegendre, IsExactUpToItsDegree) {
  for (const int count : {1, 2, 3, 5, 8, 20}) {
    const auto& rule = gauss_legendre(count);
    ASSERT_EQ(rule.size(), static_cast<std::size_t>(count));
    for (int degree = 0; degree < 2 * count; ++degree) {
      double sum = 0;
      for (const QuadraturePoint& p : rule) sum += p.weight * std::pow(p.position, degree);
      EXPECT_NEAR(sum, degree % 2 == 1 ? 0.0 : 2.0 / (degree + 1), 1e-13)
          << count << " points, degree " << degree;
    }
    // And not beyond.
    double sum = 0;
    for (const QuadraturePoint& p : rule) sum += p.weight * std::pow(p.position, 2 * count);
    EXPECT_LT(sum, 2.0 / (2 * count + 1) - (count < 10 ? 1e-6 : 0.0));
  }
}

TEST(GaussLegendre, PointsLieInTheStretchesThatTheyStandFor) {
  for (const int count : {1, 2, 3, 5, 8, 20}) {
    double end = -1;
    for (const QuadraturePoint& p : gauss_legendre(count)) {
      EXPECT_DOUBLE_EQ(p.begin, end);
      EXPECT_LT(p.begin, p.position);
      EXPECT_LT(p.position, p.end);
      end = p.end;
    }
    EXPECT_NEAR(end, 1, 1e-13);
  }
}

}  // namespace
}  // namespace blindcorner
