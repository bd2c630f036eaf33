// SPDX-License-Identifier: Apache-2.0
#include "planner/path/other_sides.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <cmath>

#include "blindcorner/planner/path/path_planner.h"
#include "test_maps.h"

namespace blindcorner {
namespace {

/// The path of a robot of no size from left to right in the middle row.
Path across(const PlanningGrid& grid) {
  const GridGeometry& geometry = grid.geometry();
  PathPlanner planner;
  const int middle = geometry.rows / 2;
  return planner.plan(
      grid,
      {geometry.center({0, middle}), {}, geometry.center({geometry.columns - 1, middle}), {}});
}

TEST(Passages, AreTheNarrowestLinesBesideEachIsland) {
  const TestMap map = map_of({
      "##################",
      "###..............#",
      "......#...........",
      "......#.....#.....",
      "......#......#....",
      "......#...........",
      "..................",
      "..................",
      "..................",
      "##################",
  });
  const PlanningGrid grid(map.geometry, map.occupancy);
  const Path path = across(grid);
  ASSERT_TRUE(path.found());
  const std::vector<Passage> passages = passages_of(grid, path);
  ASSERT_EQ(passages.size(), 2U);
  // Below the long island, and below the two cells that touch at a corner and are one.
  EXPECT_NEAR(passages[0].width, 3, 0.5);
  EXPECT_NEAR(passages[1].width, 4, 0.5);
  for (const Cell& cell : passages[0].cells) EXPECT_TRUE(grid.traversable(cell));

  const PlanningGrid closed = grid.with_closed(passages[0].cells);
  for (const Cell& cell : passages[0].cells) {
    EXPECT_FALSE(closed.traversable(cell));
    EXPECT_FALSE(closed.obstacle(map.geometry.index(cell)));
    EXPECT_TRUE(closed.is_free(VehicleFootprint::disc(0.4), {map.geometry.center(cell), 0}));
    EXPECT_FALSE(closed.with_lethal_radius(0.1).traversable(cell));
  }
  const Path other = across(closed);
  ASSERT_TRUE(other.found());
  EXPECT_GT(other.at(other.nearest({6.5, 7.5})).position.y(), 7);  // above the long island
}

TEST(Passages, AreNoneBetweenTheMapsSides) {
  const TestMap map = map_of({"#####", "..#..", ".....", "..#..", "#####"});
  const PlanningGrid grid(map.geometry, map.occupancy);
  EXPECT_TRUE(passages_of(grid, across(grid)).empty());
}

/// A wall across a hall, a little more of it to the right of a car that is eight metres before it.
/// Which side is shorter does not depend on the heading; which one can be driven does.
class OtherSides : public ::testing::Test {
 protected:
  OtherSides() {
    map_.geometry = {.columns = 180, .rows = 140, .cell_size = 0.25, .origin = {0, -17.5}};
    for (std::size_t i = 0; i < map_.geometry.cells(); ++i) {
      const Eigen::Vector2d at = map_.geometry.center(map_.geometry.cell(i));
      const bool wall = at.x() > 14 && at.x() < 15 && at.y() > -3.3 && at.y() < 2.7;
      map_.occupancy.push_back(wall || std::abs(at.y()) > 17 ? 1 : 0);
    }
  }
  /// With the narrowest passage of another path closed, if one is told.
  Path plan(double heading, double turning_radius, const Path* closed = nullptr) const {
    PathPlannerOptions options = PathPlannerOptions::car();
    options.smoothing.min_turning_radius = turning_radius;
    PathPlanner planner(options);
    PlanningGrid grid = planner.grid(map_.geometry, map_.occupancy);
    if (closed != nullptr) grid = grid.with_closed(passages_of(grid, *closed).at(0).cells);
    return planner.plan(grid, {{6, 0}, heading, {40, 0}, {}});
  }
  static double passes_at(const Path& path) {
    return path.at(path.nearest({14.5, 0})).position.y();
  }
  TestMap map_;
};

TEST_F(OtherSides, AreTakenWhereTheShorterOneIsTooTight) {
  for (const double heading : {0.6, -0.6}) {
    const Path path = plan(heading, 9);
    ASSERT_TRUE(path.found());
    EXPECT_FALSE(path.flags.curvature_exceeded) << heading;
    EXPECT_FALSE(path.flags.footprint_collides) << heading;
    EXPECT_EQ(passes_at(path) > 0, heading > 0);
  }
}

TEST_F(OtherSides, AreNotChangedForALittleLessCurvature) {
  const double heading = -0.1, radius = 25;  // which neither side allows
  const Path left = plan(heading, radius);
  ASSERT_TRUE(left.found());
  EXPECT_GT(passes_at(left), 0);
  EXPECT_TRUE(left.flags.curvature_exceeded);
  EXPECT_FALSE(left.flags.footprint_collides);
  const Path right = plan(heading, radius, &left);
  ASSERT_TRUE(right.found());
  EXPECT_LT(passes_at(right), 0);
  EXPECT_TRUE(right.flags.curvature_exceeded);
  EXPECT_LT(right.greatest_curvature, left.greatest_curvature);
  EXPECT_GT(right.greatest_curvature, left.greatest_curvature / 1.5);
  // Headed well to the right, it is so much less that the side is changed.
  EXPECT_LT(passes_at(plan(-0.6, radius)), 0);
}

TEST_F(OtherSides, AreTheSameSideBySideAndOneByOne) {
  tbb::task_arena one(1), four(4);
  for (const double radius : {9.0, 25.0}) {
    for (const double heading : {0.6, -0.1, -0.6}) {
      Path in_turn, at_once;
      one.execute([&] { in_turn = plan(heading, radius); });
      four.execute([&] { at_once = plan(heading, radius); });
      EXPECT_EQ(in_turn.expansions, at_once.expansions);
      EXPECT_EQ(in_turn.greatest_curvature, at_once.greatest_curvature);
      EXPECT_EQ(in_turn.flags.curvature_exceeded, at_once.flags.curvature_exceeded);
      ASSERT_EQ(in_turn.points.size(), at_once.points.size());
      for (std::size_t i = 0; i < in_turn.points.size(); ++i) {
        EXPECT_EQ(in_turn.points[i].position, at_once.points[i].position);
      }
    }
  }
}

}  // namespace
}  // namespace blindcorner
