// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/grid/line_of_sight.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <numbers>

#include "blindcorner/forward/error.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using testing_scenes::at;

const GridGeometry kSightGrid{.columns = 60, .rows = 60, .cell_size = 0.1, .origin = {-3.0, -3.0}};

/// A wall at x = 1 from y = -1 to 1, 2 m high, on a floor.
Scene wall_on_a_floor() {
  Scene scene;
  scene.surfaces = {testing_scenes::rectangle({1, 0, 1}, {-1, 0, 0}, 2, 2, 0.5),
                    testing_scenes::rectangle({0, 0, 0}, {0, 0, 1}, 6, 6, 0.5)};
  scene.hidden.shape = BoxShape{{0.4, 0.4, 1.0}};
  scene.hidden.anchor = Anchor::base;
  return scene;
}

bool has(const std::vector<std::size_t>& cells, double x, double y) {
  return std::ranges::binary_search(cells, kSightGrid.index(kSightGrid.cell_at({x, y})));
}

LineOfSightOptions to(double range) {
  LineOfSightOptions options;
  options.max_range = range;
  return options;
}

TEST(LineOfSight, FreeBeforeOccupiedAtUnknownBehind) {
  const LineOfSight eye(wall_on_a_floor(), kSightGrid, to(2.5));
  const LineOfSightScan scan = eye.scan(at({0.03, 0.02, 1.2}));
  EXPECT_TRUE(has(scan.free, 0.03, 0.02));
  EXPECT_TRUE(has(scan.free, 0.95, 0.0));
  // The wall is the border of two columns: the one behind it is occupied.
  EXPECT_TRUE(has(scan.surface_hits, 1.05, 0.0));
  EXPECT_FALSE(has(scan.free, 1.05, 0.0));
  EXPECT_FALSE(has(scan.free, 1.5, 0.0));
  EXPECT_FALSE(has(scan.surface_hits, 1.5, 0.0));
  EXPECT_TRUE(has(scan.free, -2.0, 0.0));
  EXPECT_FALSE(has(scan.free, -2.7, 0.0));   // out of range
  EXPECT_EQ(scan.surface_hits.size(), 20U);  // 2 m of wall, the floor is no obstacle
  EXPECT_TRUE(scan.object_hits.empty());
}

/// Three columns and two rows off, and the same turned by a right angle.
TEST(LineOfSight, WhatIsSeenIsDisplacedWithTheBelief) {
  const LineOfSight eye(wall_on_a_floor(), kSightGrid, to(2.0));
  const Transform T = at({0.03, 0.02, 1.2});
  const LineOfSightScan there = eye.scan(T), moved = eye.scan(T, {}, at({0.33, -0.18, 1.2}));
  ASSERT_EQ(moved.surface_hits.size(), there.surface_hits.size());
  const auto by = [](std::size_t cell) { return cell + 3 - 2 * std::size_t{60}; };
  for (std::size_t i = 0; i < there.surface_hits.size(); ++i) {
    EXPECT_EQ(moved.surface_hits[i], by(there.surface_hits[i]));
  }
  Transform turned = T;
  turned.linear() = Eigen::AngleAxisd(std::numbers::pi / 2, Vector3d::UnitZ()).matrix();
  const LineOfSightScan left = eye.scan(T, {}, turned);
  EXPECT_TRUE(has(left.surface_hits, 0.0, 0.95));
  EXPECT_TRUE(has(left.free, 1.05, 0.0));
}

TEST(LineOfSight, NoCellInRangeIsSkippedAndNoneIsListedTwice) {
  Scene empty = wall_on_a_floor();
  empty.surfaces.resize(1);
  empty.surfaces[0].T_world_surface.translation().x() = 100;
  const LineOfSight eye(empty, kSightGrid, to(2.5));
  const Vector2d from(0.013, -0.271);
  const LineOfSightScan scan = eye.scan(at({from.x(), from.y(), 1}));
  for (std::size_t i = 0; i < kSightGrid.cells(); ++i) {
    if ((kSightGrid.center(kSightGrid.cell(i)) - from).norm() > 2.5 - 0.071) continue;
    const bool listed = std::ranges::binary_search(scan.free, i);
    ASSERT_TRUE(listed) << i;
  }
  EXPECT_TRUE(std::ranges::is_sorted(scan.free));
  EXPECT_EQ(std::ranges::adjacent_find(scan.free), scan.free.end());
}

TEST(LineOfSight, SeesObjectsAndLowObstacles) {
  LineOfSightOptions options = to(2.5);
  const LineOfSight eye(wall_on_a_floor(), kSightGrid, options);
  Placement there;
  there.position = Vector3d(-1.25, 0.05, 0);
  const LineOfSightScan scan = eye.scan(at({0.03, 0.02, 1.2}), {there});
  EXPECT_TRUE(has(scan.object_hits, -1.06, 0.05));
  EXPECT_FALSE(has(scan.free, -1.25, 0.05));
  EXPECT_FALSE(has(scan.free, -2.0, 0.05));
  // Rays above the object alone look over it.
  options.lowest = 1.1;
  const LineOfSight high(wall_on_a_floor(), kSightGrid, options);
  EXPECT_TRUE(has(high.scan(at({0.03, 0.02, 1.2}), {there}).free, -2.0, 0.05));
}

TEST(LineOfSight, KeepsToItsField) {
  LineOfSightOptions options = to(2.5);
  options.field_of_view = M_PI / 2;
  const LineOfSight eye(wall_on_a_floor(), kSightGrid, options);
  Transform left = Transform::Identity();
  left.linear() = Eigen::AngleAxisd(M_PI / 2, Vector3d::UnitZ()).toRotationMatrix();
  const LineOfSightScan scan = eye.scan(left);
  EXPECT_TRUE(has(scan.free, 0.05, 2.0));
  EXPECT_TRUE(has(scan.free, -1.2, 1.5));
  EXPECT_FALSE(has(scan.free, 1.5, 1.2));
  EXPECT_FALSE(has(scan.free, 0.05, -2.0));
}

TEST(LineOfSight, Extremes) {
  const LineOfSight eye(wall_on_a_floor(), kSightGrid, to(2.5));
  EXPECT_TRUE(eye.scan(at({1e300, 0, 1})).free.empty());
  EXPECT_TRUE(eye.scan(at({20, 0, 1})).free.empty());
  EXPECT_FALSE(eye.scan(at({-4, 0, 1})).free.empty());  // beside the grid, in range
  EXPECT_THROW(eye.scan(at({std::numeric_limits<double>::quiet_NaN(), 0, 1})), Error);
  EXPECT_THROW(eye.scan(at({0, 0, 1}), std::vector<Placement>(2)), Error);
  EXPECT_THROW(LineOfSight(wall_on_a_floor(), kSightGrid, to(0)), Error);
  LineOfSightOptions options;
  options.layers = 0;
  EXPECT_THROW(options.validate(), Error);
  options = {};
  options.field_of_view = 7;
  EXPECT_THROW(options.validate(), Error);
  options = {};
  options.highest = 0;
  EXPECT_THROW(options.validate(), Error);
}

// Processor time: that of other programs is not counted.
TEST(LineOfSight, TakesMilliseconds) {
  const GridGeometry large{.columns = 500, .rows = 500, .cell_size = 0.1, .origin = {-25, -25}};
  const LineOfSight eye(wall_on_a_floor(), large);
  Placement there;
  there.position = Vector3d(-5, 0, 0);
  double best = 1e9;
  for (int i = 0; i < 5; ++i) {
    const std::clock_t start = std::clock();
    eye.scan(at({0, 0, 1}), {there});
    best = std::min(best, 1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
  }
  RecordProperty("ms", std::to_string(best));
  EXPECT_LT(best, 200);
}

}  // namespace
}  // namespace blindcorner
