// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/quadratic_trend.h"

#include <gtest/gtest.h>

#include <random>

namespace blindcorner {
namespace {

double quadratic(const Eigen::VectorXd& x) {
  return 0.3 + 0.5 * x[0] - 0.8 * x[1] + 0.4 * x[0] * x[0] - 0.2 * x[0] * x[1] + 0.1 * x[1] * x[1];
}

TEST(QuadraticTrend, FindsAQuadraticUnderRipple) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::vector<Eigen::VectorXd> points;
  std::vector<double> values;
  for (int i = 0; i < 40; ++i) {
    points.emplace_back(Eigen::Vector2d(normal(random), normal(random)));
    values.push_back(quadratic(points.back()) + 0.1 * normal(random));
  }
  const QuadraticTrend trend(points, values, 0.1);
  for (const Eigen::Vector2d& x : {Eigen::Vector2d(0, 0), Eigen::Vector2d(1, -0.5)}) {
    EXPECT_NEAR(trend(x), quadratic(x), 0.1);
  }
}

TEST(QuadraticTrend, OfOneValueIsThatValue) {
  const QuadraticTrend trend({Eigen::Vector2d(1, 2)}, {0.7}, 0.1);
  EXPECT_DOUBLE_EQ(trend(Eigen::Vector2d(-3, 5)), 0.7);
}

TEST(QuadraticTrend, OfNothingIsNothing) {
  EXPECT_DOUBLE_EQ(QuadraticTrend({}, {}, 0.1)(Eigen::Vector2d(1, 1)), 0.0);
}

TEST(QuadraticTrend, StaysBetweenTheValuesThatItWasMadeFrom) {
  std::vector<Eigen::VectorXd> points;
  std::vector<double> values;
  for (const double x : {-1.0, 0.0, 1.0}) {
    points.push_back(Eigen::VectorXd::Constant(1, x));
    values.push_back(x);
  }
  const QuadraticTrend trend(points, values, 0.1);
  EXPECT_DOUBLE_EQ(trend(Eigen::VectorXd::Constant(1, 100)), 1.0);
  EXPECT_DOUBLE_EQ(trend(Eigen::VectorXd::Constant(1, -100)), -1.0);
}

}  // namespace
}  // namespace blindcorner
