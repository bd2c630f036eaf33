// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/bezier.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "blindcorner/forward/constants.h"

namespace blindcorner {
namespace {

/// The usual approximation of a quarter circle of radius 2 about the origin: its radius is right to
/// 2.7e-4 of it.
CubicBezier quarter_circle() {
  const double k = 4.0 / 3.0 * (std::sqrt(2.0) - 1);
  return {{Eigen::Vector2d(2, 0), Eigen::Vector2d(2, 2 * k), Eigen::Vector2d(2 * k, 2),
           Eigen::Vector2d(0, 2)}};
}

/// y = x^2 for x from -1 to 1, exactly.
CubicBezier parabola() {
  return {{Eigen::Vector2d(-1, 1), Eigen::Vector2d(-1.0 / 3, -1.0 / 3),
           Eigen::Vector2d(1.0 / 3, -1.0 / 3), Eigen::Vector2d(1, 1)}};
}

TEST(CubicBezier, ParabolaHasItsCurvatureHeadingAndLength) {
  const CubicBezier curve = parabola();
  for (int i = 0; i <= 20; ++i) {
    const double t = i / 20.0, x = 2 * t - 1;
    EXPECT_NEAR((curve.point(t) - Eigen::Vector2d(x, x * x)).norm(), 0, 1e-14);
    EXPECT_NEAR(curve.curvature(t), 2 / std::pow(1 + 4 * x * x, 1.5), 1e-12);
    EXPECT_NEAR(curve.heading(t), std::atan(2 * x), 1e-12);
  }
  const double length = std::sqrt(5.0) + 0.5 * std::asinh(2.0);
  EXPECT_NEAR(curve.length(), length, 1e-8);
  EXPECT_NEAR(curve.length(0, 0.3) + curve.length(0.3, 1), length, 1e-8);
}

TEST(CubicBezier, QuarterCircleTurnsLeftWithItsRadius) {
  const CubicBezier curve = quarter_circle();
  EXPECT_NEAR(curve.length(), kPi, 1e-3);
  EXPECT_NEAR(curve.heading(0), kPi / 2, 1e-12);
  EXPECT_NEAR(curve.heading(1), kPi, 1e-12);
  for (int i = 0; i <= 10; ++i) EXPECT_NEAR(curve.curvature(i / 10.0), 0.5, 0.011);
}

TEST(CubicBezier, CollinearPointsAreAStraightLine) {
  const Eigen::Vector2d a(1, 2), d(3, 1);
  const CubicBezier curve{{a, a + d, a + 2 * d, a + 3 * d}};
  EXPECT_NEAR(curve.length(), 3 * d.norm(), 1e-12);
  for (const double t : {0.0, 0.4, 1.0}) {
    EXPECT_NEAR(curve.curvature(t), 0, 1e-14);
    EXPECT_NEAR(curve.heading(t), std::atan2(1, 3), 1e-12);
  }
  // There and back again: a turn on the spot has no curvature along the line.
  const CubicBezier back{{a, a + 2 * d, a + 2 * d, a}};
  for (const double t : {0.0, 0.5, 1.0}) EXPECT_NEAR(back.curvature(t), 0, 1e-12);
  EXPECT_NEAR(back.length(), 2 * 1.5 * d.norm(), 1e-6);
}

TEST(CubicBezier, RepeatedPointsHaveTheLimitsOfTheirEnds) {
  const Eigen::Vector2d a(0, 0), b(2, 0), c(2, 2);
  const CubicBezier start{{a, a, b, c}};
  EXPECT_EQ(start.heading(0), 0);
  EXPECT_EQ(start.curvature(0), std::numeric_limits<double>::infinity());
  const CubicBezier end{{a, b, c, c}};
  EXPECT_NEAR(end.heading(1), kPi / 2, 1e-12);
  const CubicBezier both{{a, a, b, b}};
  for (const double t : {0.0, 0.5, 1.0}) {
    EXPECT_EQ(both.heading(t), 0);
    EXPECT_EQ(both.curvature(t), 0);
  }
  const CubicBezier thrice{{a, a, a, c}};
  EXPECT_NEAR(thrice.heading(0), kPi / 4, 1e-12);
  EXPECT_EQ(thrice.curvature(0), 0);
}

TEST(CubicBezier, OnePointIsAPlaceWithoutLength) {
  const Eigen::Vector2d a(3, 4);
  const CubicBezier point{{a, a, a, a}};
  EXPECT_NEAR((point.point(0.3) - a).norm(), 0, 1e-15 * a.norm() * 4);
  EXPECT_EQ(point.heading(0.3), 0);
  EXPECT_EQ(point.curvature(0.3), 0);
  EXPECT_EQ(point.length(), 0);
}

TEST(CubicBezier, LengthOfACuspIsFound) {
  const CubicBezier cusp{
      {Eigen::Vector2d(0, 0), Eigen::Vector2d(1, 1), Eigen::Vector2d(0, 1), Eigen::Vector2d(1, 0)}};
  double sum = 0;
  constexpr int kParts = 200'000;  // a chord is then right to 1e-5 of the cusp's own length
  for (int i = 0; i < kParts; ++i) {
    sum += (cusp.point((i + 1.0) / kParts) - cusp.point(static_cast<double>(i) / kParts)).norm();
  }
  EXPECT_NEAR(cusp.length(), sum, 1e-6);
}

}  // namespace
}  // namespace blindcorner
