// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/path_planner.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "planner/path/curve.h"
#include "planner/path/dubins.h"
#include "planner/path/turning_path.h"
#include "test_maps.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;

/// What every path promises: its own points agree with each other, are at most `spacing` apart, and
/// the vehicle touches nothing at them and between them.
void check_path(const PlanningGrid& grid, const PathPlannerOptions& options, const Path& path) {
  ASSERT_TRUE(path.found());
  EXPECT_EQ(path.points.front().arc_length, 0);
  EXPECT_DOUBLE_EQ(path.points.back().arc_length, path.length);
  for (std::size_t i = 1; i < path.points.size(); ++i) {
    const PathPoint &a = path.points[i - 1], &b = path.points[i];
    ASSERT_GT(b.arc_length, a.arc_length);
    ASSERT_LE(b.arc_length - a.arc_length, options.point_spacing + 1e-9);
    ASSERT_NEAR((b.position - a.position).norm(), b.arc_length - a.arc_length,
                0.02 * options.point_spacing);
  }
  for (double s = 0; s <= path.length; s += 0.05) {
    const PathPoint place = path.at(s);
    ASSERT_TRUE(grid.is_free(options.footprint, {place.position, place.heading})) << s;
  }
}

/// Curvature and its rate are within what the vehicle can do with the speed that it can have there.
void check_limits(const CurveLimits& limits, double start_speed, const Path& path) {
  for (std::size_t i = 1; i < path.points.size(); ++i) {
    const PathPoint &a = path.points[i - 1], &b = path.points[i];
    const double v = limits.speed(start_speed, b.arc_length);
    const double before =
        limits.speed(start_speed, a.arc_length - 3);  // a step's rate is its begin's
    if (std::abs(b.curvature) > std::abs(a.curvature)) {
      ASSERT_LE(std::abs(b.curvature), 1.03 * limits.curvature(v) + 1e-9) << b.arc_length;
    }
    const double rate = std::abs(b.curvature - a.curvature) / (b.arc_length - a.arc_length);
    ASSERT_LE(rate,
              1.03 * std::max(limits.curvature_rate(v), limits.curvature_rate(before)) + 1e-9);
  }
}

TEST(Curve, IsAClothoidWhoseEndIsMet) {
  const Curve circle{{{1, 2}, 0.3, 0, 0}, 1, 6, std::vector<double>(7, 0.25)};
  const PathPoint end = circle.points(0.5).back();
  const Vector2d center = Vector2d(1, 2) + 4 * Vector2d(-std::sin(0.3), std::cos(0.3));
  EXPECT_NEAR((end.position - center).norm(), 4, 1e-6);
  EXPECT_NEAR(end.heading, 0.3 + 1.5, 1e-12);
  for (const double weight : {0.0, 1.0}) {
    const CurveEnd wanted{end.position + Vector2d(0.3, -0.2), end.heading + 0.1};
    const PathPoint moved = fitted(circle, wanted, weight).points(0.25).back();
    EXPECT_NEAR((moved.position - wanted.position).norm(), 0, 1e-5);
    EXPECT_NEAR(moved.heading, *wanted.heading, 1e-5);
  }
}

TEST(Curve, WeavingIsStraightenedOut) {
  Curve weaving{{}, 1, 20, {}};
  for (int i = 0; i <= 20; ++i) weaving.curvature.push_back(i % 2 == 0 ? 0.05 : -0.05);
  const PathPoint end = weaving.points(0.25).back();
  const Curve straight = fitted(weaving, {end.position, end.heading}, 1);
  double most = 0;
  for (std::size_t i = 3; i + 3 < straight.curvature.size(); ++i) {
    most = std::max(most, std::abs(straight.curvature[i]));
  }
  EXPECT_LT(most, 0.02);
}

TEST(Dubins, LengthsOfCurvesThatAreKnown) {
  const PlanarPose start{{0, 0}, 0};
  EXPECT_NEAR(dubins_length(start, {{7, 0}, 0}, 2), 7, 1e-9);
  EXPECT_NEAR(dubins_length(start, {{2, 2}, kPi / 2}, 2), kPi, 1e-9);  // a quarter of a circle
  EXPECT_NEAR(dubins_length(start, {{2, -2}, -kPi / 2}, 2), kPi, 1e-9);
  EXPECT_NEAR(dubins_length(start, {{0, 4}, kPi}, 2), 2 * kPi, 1e-9);
  EXPECT_NEAR(dubins_length(start, {{4, 4}, 0}, 2), 2 * kPi, 1e-9);        // one to each side
  EXPECT_NEAR(dubins_length(start, {{0, 0}, kPi}, 1), 7 * kPi / 3, 1e-9);  // three turns
  EXPECT_NEAR(dubins_length({{3, 1}, 1}, {{3, 1}, 1}, 1), 0, 1e-9);
}

/// A street of 10 m that turns left after 30 m, cells of 0.25 m.
class StreetTurn : public ::testing::Test {
 protected:
  StreetTurn() {
    map_.geometry = {.columns = 180, .rows = 180, .cell_size = 0.25};
    map_.occupancy.assign(map_.geometry.cells(), 0);
    fill(0, 30, 10, 45, 1);
    fill(40, 45, 0, 45, 1);
    options_ = PathPlannerOptions::car();
    options_.curves.lateral_acceleration = 6;
    options_.curves.curvature_speed = 0.12;
    options_.curves.braking = 3.5;
  }
  void fill(double left, double right, double bottom, double top, double probability) {
    for (std::size_t i = 0; i < map_.geometry.cells(); ++i) {
      const Vector2d at = map_.geometry.center(map_.geometry.cell(i));
      if (at.x() > left && at.x() < right && at.y() > bottom && at.y() < top) {
        map_.occupancy[i] = probability;
      }
    }
  }
  Path plan(double speed) {
    options_.curves.wanted_speed = speed;
    const PathPlanner planner(options_);
    const PlanningGrid grid = planner.grid(map_.geometry, map_.occupancy);
    PathRequest request{{4, 5}, 0.0, finish_, 0, speed};
    const Path path = planner.plan(grid, request);
    if (path.found()) {
      check_path(grid, options_, path);
      check_limits(options_.curves, speed, path);
    }
    return path;
  }

  TestMap map_;
  PathPlannerOptions options_;
  PathGoal finish_{{30, 42}, {}, Vector2d(40, 42)};
};

TEST_F(StreetTurn, IsDrivenAtEverySpeedThatItAllows) {
  for (const double speed : {1.0, 5.0, 8.0, 11.0, 14.0}) {
    const Path path = plan(speed);
    ASSERT_TRUE(path.found()) << speed;
    EXPECT_NEAR(path.points.back().position.y(), 42, 0.1) << speed;
    EXPECT_LT(path.length, 75);
  }
}

TEST_F(StreetTurn, WhoHoldsAHighSpeedHasNoPath) {
  options_.curves.braking = 0;
  EXPECT_TRUE(plan(8).found());
  // 18^2 / 6 = 54 m of radius do not fit into a street of 10 m.
  EXPECT_FALSE(plan(18).found());
}

TEST_F(StreetTurn, PassesWhatStandsInTheLaneOnEitherSide) {
  for (const double x : {31.5, 33.5, 35.0, 36.5, 38.0}) {
    const TestMap empty = map_;
    fill(x - 1, x + 1, 24, 26, 1);
    EXPECT_TRUE(plan(8).found()) << x;
    map_ = empty;
  }
}

TEST_F(StreetTurn, APlanIsAsSmoothAsTheWay) {
  const Path path = plan(8);
  ASSERT_TRUE(path.found());
  // Curvature rises once and falls once; a wiggle would turn back.
  int turns_back = 0;
  for (std::size_t i = 2; i < path.points.size(); ++i) {
    const double a = path.points[i - 1].curvature - path.points[i - 2].curvature;
    const double b = path.points[i].curvature - path.points[i - 1].curvature;
    if (a * b < 0 && std::min(std::abs(a), std::abs(b)) > 1e-3) ++turns_back;
  }
  EXPECT_LE(turns_back, 6);
}

TEST_F(StreetTurn, IsLeftWhereTheRoadIsClosed) {
  fill(0, 45, 20, 21, 1);
  EXPECT_EQ(plan(8).status, PathStatus::no_path);
  fill(0, 45, 41, 43, 1);
  EXPECT_EQ(plan(8).status, PathStatus::goal_blocked);
}

TEST(DrivablePath, EndsWhereAndAsItIsTold) {
  const GridGeometry geometry{.columns = 200, .rows = 200, .cell_size = 0.2};
  const PathPlanner planner(PathPlannerOptions::car());
  const PlanningGrid grid = planner.grid(geometry, std::vector<double>(geometry.cells(), 0));
  for (const double degrees : {0.0, 45.0, -120.0}) {
    const PathRequest request{{12, 20}, 0.0, {{27, 21}, degrees * kDegree, {}}, 0, 0};
    const Path path = planner.plan(grid, request);
    check_path(grid, planner.options(), path);
    EXPECT_LE(path.greatest_curvature(), 1.03 / 5.5) << degrees;
    EXPECT_NEAR((path.points.back().position - request.goal.point).norm(), 0, 0.02);
    EXPECT_NEAR(std::remainder(path.points.back().heading - degrees * kDegree, 2 * kPi), 0, 0.02);
  }
  const Path same = planner.plan(grid, {{12, 20}, 0.0, {{12, 20}, {}, {}}, 0, 0});
  ASSERT_TRUE(same.found());
  EXPECT_EQ(same.points.size(), 1U);
}

TEST(DrivablePath, BeginsWithTheCurvatureThatIsDriven) {
  const GridGeometry geometry{.columns = 200, .rows = 200, .cell_size = 0.2};
  PathPlannerOptions options = PathPlannerOptions::car();
  options.curves.curvature_speed = 0.12;
  const PathPlanner planner(options);
  const PlanningGrid grid = planner.grid(geometry, std::vector<double>(geometry.cells(), 0));
  const Path path = planner.plan(grid, {{8, 20}, 0.0, {{32, 20}, {}, {}}, 0.1, 6});
  check_path(grid, options, path);
  check_limits(options.curves, 6, path);
  EXPECT_EQ(path.points.front().curvature, 0.1);
}

TEST(DrivablePath, WhatTurnsOnTheSpotDoesSoBeforeItDrivesOff) {
  const GridGeometry geometry{.columns = 100, .rows = 100, .cell_size = 0.05};
  PathPlannerOptions options = PathPlannerOptions::robot();
  options.curves.turning_radius = 0.2;
  options.turns_on_the_spot = true;
  options.point_spacing = 0.05;
  const PathPlanner planner(options);
  const PlanningGrid grid = planner.grid(geometry, std::vector<double>(geometry.cells(), 0));
  const PathRequest request{{2, 2}, kPi, {{4, 2}, {}, {}}, 0, 0};
  const Path path = planner.plan(grid, request);
  check_path(grid, options, path);
  EXPECT_NEAR(path.length, 2, 0.05);
  options.turns_on_the_spot = false;
  EXPECT_GT(PathPlanner(options).plan(grid, request).length, 2.3);
}

TEST(TurningPath, RoundsCornersAsFarAsThereIsRoom) {
  const TestMap map = map_of({"........", "........", "..####..", "..####..", "........"}, 1);
  PathPlannerOptions options;
  options.footprint = VehicleFootprint::disc(0.3);
  const PathPlanner planner(options);
  const PlanningGrid grid = planner.grid(map.geometry, map.occupancy);
  const Path path = planner.plan(grid, {{1.5, 0.5}, {}, {{6.5, 3.5}, {}, {}}, 0, 0});
  check_path(grid, options, path);
  EXPECT_LT(path.length, 7.9);  // steps between cells are 8 m
  EXPECT_LT(path.greatest_curvature(), 20);
}

TEST(TurningPath, IsFreeOnEveryMap) {
  std::mt19937_64 random(3);
  PathPlannerOptions options;
  options.point_spacing = 0.2;
  int found = 0;
  for (int repeat = 0; repeat < 40; ++repeat) {
    const TestMap map = blocks_map(random, 60, 0.2, 25, 8);
    options.footprint =
        repeat % 2 == 0 ? VehicleFootprint::disc(0.15) : VehicleFootprint::rectangle(0.5, 0.3);
    const PathPlanner planner(options);
    const PlanningGrid grid = planner.grid(map.geometry, map.occupancy);
    const Path path = planner.plan(grid, {{0.7, 0.7}, {}, {{11.3, 11.3}, {}, {}}, 0, 0});
    if (!path.found()) continue;
    ++found;
    EXPECT_NEAR((path.points.back().position - Vector2d(11.3, 11.3)).norm(), 0, 1e-9);
    for (double s = 0; s <= path.length; s += 0.03) {
      const PathPoint place = path.at(s);
      // Between two points a chord may cut a bend by less than a hundredth of their spacing.
      ASSERT_TRUE(grid.disc_is_free(place.position, options.footprint.inscribed_radius() - 0.01));
    }
  }
  EXPECT_GE(found, 10);
}

// Of cells as wide as the vehicle, a straight line that the cells take for free may touch a corner.
TEST(TurningPath, GoesOverTheCellsWhereAStraightLineTouches) {
  TestMap map{{.columns = 30, .rows = 20, .cell_size = 1}, {}};
  map.occupancy.assign(map.geometry.cells(), 0);
  for (int row = 5; row < 20; ++row) map.occupancy[map.geometry.index({15, row})] = 1;
  for (const double radius : {0.2, 0.4}) {
    PathPlannerOptions options;
    options.footprint = VehicleFootprint::disc(radius);
    const PathPlanner planner(options);
    const PlanningGrid grid = planner.grid(map.geometry, map.occupancy);
    const Path path = planner.plan(grid, {{2, 10}, {}, {{28, 10}, {}, {}}, 0, 0});
    ASSERT_TRUE(path.found()) << radius;
    for (double s = 0; s <= path.length; s += 0.05) {
      // Between two looks, a quarter of a cell apart, a corner is missed by less than
      // 0.2 - sqrt(0.2^2 - 0.125^2).
      ASSERT_TRUE(grid.disc_is_free(path.at(s).position, radius - 0.05)) << s;
    }
    EXPECT_LT(path.length, 31) << radius;
  }
}

TEST(Shortcut, StraightensWhatIsFree) {
  const TestMap map = map_of({"......", "......", "......"});
  const PlanningGrid grid(map.geometry, map.occupancy);
  const std::vector<Vector2d> points{{0.5, 0.5}, {1.5, 1.5}, {2.5, 1.5}, {5.5, 1.5}};
  const std::vector<Vector2d> corners = shortcut(grid, points);
  ASSERT_EQ(corners.size(), 2U);
  EXPECT_EQ(corners.front(), points.front());
  EXPECT_EQ(corners.back(), points.back());
}

TEST(Shortcut, NeverCostsMore) {
  std::mt19937_64 random(8);
  GridSearch search;
  for (int repeat = 0; repeat < 100; ++repeat) {
    const TestMap map = random_map(random, 30, 30, 0.15, 0.6);
    PlanningGridOptions options;
    options.risk_weight = repeat % 2 == 0 ? 0 : 4;
    const PlanningGrid grid(map.geometry, map.occupancy, options);
    const CellPath path = search.search(grid, {0, 0}, {29, 29});
    if (path.status != PathStatus::found) continue;
    std::vector<Vector2d> points;
    for (const Cell& cell : path.cells) points.push_back(map.geometry.center(cell));
    const std::vector<Vector2d> corners = shortcut(grid, points);
    double cost = 0;
    for (std::size_t i = 1; i < corners.size(); ++i) {
      cost += grid.line_cost(corners[i - 1], corners[i]);
    }
    EXPECT_LE(cost, path.cost * (1 + 1e-6));
  }
}

TEST(PathPlanner, RefusesNonsense) {
  const TestMap map = map_of({"....", "...."});
  const PathPlanner point, car(PathPlannerOptions::car());
  const PlanningGrid grid = point.grid(map.geometry, map.occupancy);
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(point.plan(grid, {{nothing, 0}, {}, {{1, 1}, {}, {}}, 0, 0}), Error);
  EXPECT_THROW(car.plan(grid, {{1, 1}, 0.0, {{1, 1}, {}, {}}, nothing, 0}), Error);
  EXPECT_THROW(point.plan(grid, {{1, 1}, {}, {{1, 1}, {}, Vector2d(1, 2)}, 0, 0}), Error);
  EXPECT_EQ(point.plan(grid, {{-1, 1}, {}, {{1, 1}, {}, {}}, 0, 0}).status,
            PathStatus::start_outside);
  EXPECT_EQ(car.plan(grid, {{1, 1}, {}, {{9, 1}, {}, {}}, 0, 0}).status, PathStatus::goal_outside);
  PathPlannerOptions options;
  options.curves.turning_radius = -1;
  EXPECT_THROW(PathPlanner{options}, Error);
}

}  // namespace
}  // namespace blindcorner
