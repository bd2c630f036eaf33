// SPDX-License-Identifier: Apache-2.0
#include "planner/path/least_curved.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "blindcorner/planner/path/path_planner.h"
#include "test_maps.h"

namespace blindcorner {
namespace {

TEST(SignedClearance, IsTheDistanceFromTheEdgeOnBothSides) {
  const TestMap map = map_of({".......", ".#####.", ".#####.", ".#####.", "......."}, 0.5);
  const PlanningGrid grid(map.geometry, map.occupancy);
  const std::vector<double> clearance = signed_clearance(grid, 0.6);
  const auto at = [&](int column, int row) { return clearance[map.geometry.index({column, row})]; };
  EXPECT_NEAR(at(0, 2), 0.25, 1e-6);  // centre to square
  EXPECT_NEAR(at(0, 0), 0.25 * std::numbers::sqrt2, 1e-6);
  EXPECT_NEAR(at(1, 2), -0.25, 1e-6);
  EXPECT_NEAR(at(3, 2), -0.6, 1e-6);  // no farther than asked
}

/// Two streets of a width at a right angle, as far as the map reaches; the corner's block is on the
/// left of who turns.
TestMap corner_of(double width, double cell) {
  TestMap map;
  map.geometry = {.columns = static_cast<int>(80 / cell),
                  .rows = static_cast<int>(80 / cell),
                  .cell_size = cell};
  for (std::size_t i = 0; i < map.geometry.cells(); ++i) {
    const Eigen::Vector2d place = map.geometry.center(map.geometry.cell(i));
    const bool along = place.y() > 1 && place.y() < 1 + width;
    const bool up = place.x() > 70 - width && place.x() < 70 && place.y() > 1;
    map.occupancy.push_back(along || up ? 0 : 1);
  }
  return map;
}

/// An arc that touches both outer walls and the inner corner: the distance of its middle from where
/// the walls meet is R (sqrt(2) - 1), for a disc of radius r on walls moved in by r, and the corner
/// is sqrt(2) (width - r) from there.
double widest_turn(double width, double r) {
  return (std::numbers::sqrt2 * (width - r) - r) / (std::numbers::sqrt2 - 1);
}

Path turn_around(double width, double radius_of_turn, double rate = 0) {
  constexpr double kDisc = 1;
  const TestMap map = corner_of(width, 0.25);
  PathPlannerOptions options;
  options.smoothing.footprint = VehicleFootprint::disc(kDisc);
  options.smoothing.min_turning_radius = radius_of_turn;
  options.smoothing.max_curvature_rate = rate;
  PathPlanner planner(options);
  const PlanningGrid grid = planner.grid(map.geometry, map.occupancy);
  return planner.plan(grid, {{3, 3}, 0.0, {68, 76}, {}});
}

TEST(LeastCurved, TakesTheWholeWidthOfACorner) {
  constexpr double kWidth = 10;
  const double widest = widest_turn(kWidth, 1);
  EXPECT_NEAR(widest, 28.3, 0.05);
  const Path fits = turn_around(kWidth, 0.85 * widest);
  ASSERT_TRUE(fits.found());
  EXPECT_FALSE(fits.flags.curvature_exceeded);
  EXPECT_FALSE(fits.flags.partly_unsmoothed);
  EXPECT_FALSE(fits.flags.footprint_collides);
  EXPECT_LE(fits.greatest_curvature * 0.85 * widest, 1.001);
  // No curve is flatter than the arc; this one says so, touches nothing, and is nearly as flat.
  const Path cannot = turn_around(kWidth, 1.5 * widest);
  ASSERT_TRUE(cannot.found());
  EXPECT_TRUE(cannot.flags.curvature_exceeded);
  EXPECT_FALSE(cannot.flags.footprint_collides);
  EXPECT_GE(cannot.greatest_curvature * widest, 0.99);
  EXPECT_LE(cannot.greatest_curvature * widest, 1.4);
}

TEST(LeastCurved, CurvatureChangesNoFasterThanTheSteering) {
  constexpr double kRate = 0.01;  // 1/m^2: 5 m to a radius of 20 m
  const Path path = turn_around(10, 15, kRate);
  ASSERT_TRUE(path.found());
  EXPECT_FALSE(path.flags.curvature_exceeded);
  double most = 0;
  for (const CubicBezier& piece : path.pieces) {
    for (int i = 1; i <= 50; ++i) {
      const double a = (i - 1) / 50.0, b = i / 50.0;
      const double change = std::abs(piece.curvature(b) - piece.curvature(a));
      most = std::max(most, change / piece.length(a, b));
    }
  }
  EXPECT_LE(most, 1.06 * kRate);
  EXPECT_GT(most, 0.1 * kRate);
}

/// The street of scenes/street_turn.json with its cyclist known where it stands.
TestMap street_with(const Eigen::Vector2d& cyclist, double yaw) {
  TestMap map;
  map.geometry = {.columns = 192, .rows = 200, .cell_size = 0.25, .origin = {-20, -8}};
  const Eigen::Vector2d ahead(std::cos(yaw), std::sin(yaw)), left(-ahead.y(), ahead.x());
  for (std::size_t i = 0; i < map.geometry.cells(); ++i) {
    const Eigen::Vector2d place = map.geometry.center(map.geometry.cell(i));
    const Eigen::Vector2d from = place - cyclist;
    const bool stands = std::abs(from.dot(ahead)) < 1.1 && std::abs(from.dot(left)) < 0.4;
    const bool building = place.x() < 16 && place.y() > 7;
    const bool facade = place.x() > 26 || place.y() < -5;
    map.occupancy.push_back(stands || building || facade ? 1 : 0);
  }
  return map;
}

TEST(LeastCurved, LeadsAroundAKnownCyclistAtTheSpeedOfTheTurn) {
  // Where a car that was told the truth once stood, or slid.
  const std::vector<std::pair<Eigen::Vector3d, double>> cases{
      {{22.2, 17.4, 0.71}, 10.5}, {{21.6, 21.9, 2.89}, 10.6}, {{21.1, 22.0, 2.75}, 8.2},
      {{20.8, 22.4, 1.08}, 7.5},  {{18.4, 18.4, 1.42}, 6.7},
  };
  constexpr double kShare = 0.6;  // of friction: above 1 / kShare turning radii the car slides
  for (const auto& [pose, speed] : cases) {
    const TestMap map = street_with(pose.head<2>(), pose.z());
    PathPlannerOptions options = PathPlannerOptions::car();
    options.grid.risk_weight = 10;
    options.smoothing.footprint = VehicleFootprint::rectangle(4.86, 2.16);
    options.smoothing.min_turning_radius = std::max(5.5, speed * speed / (kShare * 8.83));
    options.smoothing.max_curvature_rate = 0.4 / (2.6 * speed);
    PathPlanner planner(options);
    const PlanningGrid grid = planner.grid(map.geometry, map.occupancy);
    const Path path = planner.plan(grid, {{-15, 2}, 0.0, {21, 36}, {}});
    ASSERT_TRUE(path.found());
    EXPECT_FALSE(path.flags.footprint_collides) << speed;
    EXPECT_FALSE(path.flags.partly_unsmoothed) << speed;
    EXPECT_LE(path.greatest_curvature * options.smoothing.min_turning_radius, 0.95 / kShare)
        << speed;
  }
}

}  // namespace
}  // namespace blindcorner
