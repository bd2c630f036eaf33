// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/path.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "blindcorner/forward/constants.h"
#include "unit/planner/control/test_paths.h"

namespace blindcorner {
namespace {

TEST(PathPoints, IsInterpolatedAndClamped) {
  const auto path = straight_path(10, 1);
  EXPECT_DOUBLE_EQ(path_at(path, 3.25).position.x(), 3.25);
  EXPECT_DOUBLE_EQ(path_at(path, -1).position.x(), 0);
  EXPECT_DOUBLE_EQ(path_at(path, 11).position.x(), 10);
}

TEST(PathPoints, TakesTheShorterWayBetweenHeadings) {
  std::vector<PathPoint> path(2);
  path[0].heading = kPi - 0.1;
  path[1].heading = -kPi + 0.1;
  path[1].arc_length = 1;
  EXPECT_NEAR(path_at(path, 0.5).heading, kPi, 1e-12);
}

TEST(PathPoints, NearestIsLookedForInTheGivenPart) {
  const auto path = turn_path(5, 0, 4 * kPi, 0, 0.05);  // two rounds
  const Eigen::Vector2d start(0, 0);
  EXPECT_NEAR(nearest_arc_length(path, start, 0, 5), 0, 1e-9);
  EXPECT_NEAR(nearest_arc_length(path, start, 20, 40), 10 * kPi, 0.01);
  EXPECT_DOUBLE_EQ(nearest_arc_length(path, start, 2, 4), 2);
}

TEST(PathGoal, IsPassedWithinItsLine) {
  const PathGoal line{{2, 1}, {}, Eigen::Vector2d(2, 4)};
  ASSERT_TRUE(line.crossing({1, 2}, {5, 2}).has_value());
  EXPECT_NEAR(*line.crossing({1, 2}, {5, 2}), 0.25, 1e-12);
  EXPECT_NEAR(*line.crossing({5, 2}, {1, 2}), 0.75, 1e-12);   // from either side
  EXPECT_FALSE(line.crossing({1, 5}, {5, 5}).has_value());    // beside it
  EXPECT_FALSE(line.crossing({1, 2}, {1.9, 2}).has_value());  // before it
  EXPECT_FALSE(line.crossing({2, 0}, {2, 5}).has_value());    // along it
  EXPECT_FALSE((PathGoal{{2, 1}, {}, {}}.crossing({1, 1}, {3, 1}).has_value()));
}

}  // namespace
}  // namespace blindcorner
