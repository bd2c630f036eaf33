// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/planning_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "test_maps.h"

namespace blindcorner {
namespace {

constexpr double kForbidden = std::numeric_limits<double>::infinity();

/// From a point to the nearest obstacle's square.
double brute_force_distance(const TestMap& map, const Eigen::Vector2d& point) {
  double least = kForbidden;
  for (std::size_t i = 0; i < map.geometry.cells(); ++i) {
    if (!(map.occupancy[i] >= 0.65)) continue;
    const Eigen::Vector2d half = Eigen::Vector2d::Constant(0.5 * map.geometry.cell_size);
    const Eigen::Vector2d offset =
        (point - map.geometry.center(map.geometry.cell(i))).cwiseAbs() - half;
    least = std::min(least, offset.cwiseMax(0).norm());
  }
  return least;
}

TEST(PlanningGrid, InflatesByTheRadiusToTheCell) {
  std::mt19937_64 random(3);
  for (const double radius : {0.0, 0.05, 0.24, 0.25, 0.5, 0.9}) {
    const TestMap map = random_map(random, 30, 20, 0.02, 0, 0.1);
    PlanningGridOptions options;
    options.lethal_radius = radius;
    const PlanningGrid grid(map.geometry, map.occupancy, options);
    for (std::size_t i = 0; i < map.geometry.cells(); ++i) {
      const Cell cell = map.geometry.cell(i);
      const double distance = brute_force_distance(map, map.geometry.center(cell));
      // Radii are no distances on this lattice but for 0.05 and 0.25, which may be touched.
      EXPECT_EQ(grid.traversable(cell), map.occupancy[i] < 0.65 && distance > radius - 1e-9);
      EXPECT_EQ(grid.with_lethal_radius(0.3).traversable(cell), distance > 0.3 - 1e-9);
    }
  }
}

TEST(PlanningGrid, DiscsAreCheckedExactly) {
  std::mt19937_64 random(4);
  const TestMap map = random_map(random, 25, 25, 0.05, 0, 0.2);
  const PlanningGrid grid(map.geometry, map.occupancy);
  std::uniform_real_distribution<double> place(-0.5, 5.5), radius(0.01, 1);
  for (int i = 0; i < 3000; ++i) {
    const Eigen::Vector2d point(place(random), place(random));
    const double r = radius(random), distance = brute_force_distance(map, point);
    if (std::abs(distance - r) < 1e-5) continue;  // touching
    EXPECT_EQ(grid.disc_is_free(point, r), distance > r);
  }
}

TEST(PlanningGrid, DiscsCoverARectangleAndLittleMore) {
  const VehicleFootprint car = VehicleFootprint::rectangle(4.5, 1.8, 1.3);
  EXPECT_LE(car.disc_radius(), 1.1 * 0.9);
  EXPECT_DOUBLE_EQ(car.inscribed_radius(), 0.9);
  EXPECT_GE(car.circumscribed_radius(), std::hypot(2.25 + 1.3, 0.9));
  for (double x = -2.25; x <= 2.25; x += 0.01) {
    double least = kForbidden;
    for (const double offset : car.disc_offsets()) {
      least = std::min(least, std::hypot(x + 1.3 - offset, 0.9));
    }
    EXPECT_LE(least, car.disc_radius() + 1e-12);
  }
  EXPECT_THROW(VehicleFootprint::rectangle(0, 1), Error);
  EXPECT_THROW(VehicleFootprint::disc(-1), Error);
}

TEST(PlanningGrid, ACarFitsAlongACorridorButNotAcross) {
  const TestMap map = map_of({"####################", "....................",
                              "....................", "####################"});
  const PlanningGrid grid(map.geometry, map.occupancy);
  const VehicleFootprint car = VehicleFootprint::rectangle(4.5, 1.8);
  EXPECT_TRUE(grid.is_free(car, {{10, 2}, 0}));
  EXPECT_FALSE(grid.is_free(car, {{10, 2}, kPi / 2}));
  EXPECT_FALSE(grid.is_free(car, {{10, 2.2}, 0}));
  EXPECT_FALSE(grid.is_free(car, {{-1, 2}, 0}));  // beside the map
}

TEST(PlanningGrid, RiskFallsWithTheSquareOfTheDistance) {
  std::mt19937_64 random(5);
  TestMap map = random_map(random, 16, 12, 0.05, 0.4, 0.5);
  map.occupancy[7] = std::numeric_limits<double>::quiet_NaN();
  PlanningGridOptions options;
  options.risk_radius = 1.7;
  options.risk_weight = 4;
  options.unknown_occupancy = 0.45;
  const PlanningGrid grid(map.geometry, map.occupancy, options);
  double least = kForbidden;
  for (std::size_t i = 0; i < map.geometry.cells(); ++i) {
    const Eigen::Vector2d here = map.geometry.center(map.geometry.cell(i));
    double risk = 0;
    for (std::size_t k = 0; k < map.geometry.cells(); ++k) {
      const double p = std::isnan(map.occupancy[k]) ? 0.45 : map.occupancy[k];
      const double distance = (map.geometry.center(map.geometry.cell(k)) - here).norm();
      risk = std::max(risk, p - std::pow(distance / 1.7, 2));
    }
    EXPECT_NEAR(grid.cost_factor(i), 1 + 4 * risk, 1e-5);  // single precision
    if (grid.traversable(map.geometry.cell(i))) least = std::min(least, grid.cost_factor(i));
  }
  EXPECT_EQ(grid.least_cost_factor(), least);
}

TEST(PlanningGrid, UnknownCellsCountAsTheyAreTold) {
  const TestMap map = map_of({".?."});
  EXPECT_TRUE(PlanningGrid(map.geometry, map.occupancy).traversable({1, 0}));
  PlanningGridOptions closed;
  closed.unknown_occupancy = 1;
  EXPECT_FALSE(PlanningGrid(map.geometry, map.occupancy, closed).traversable({1, 0}));
}

TEST(PlanningGrid, AClosedBorderKeepsTheVehicleInside) {
  const TestMap map = map_of({".....", ".....", ".....", ".....", "....."});
  PlanningGridOptions options;
  options.lethal_radius = 1.2;
  EXPECT_TRUE(PlanningGrid(map.geometry, map.occupancy, options).traversable({0, 0}));
  options.closed_border = true;
  const PlanningGrid closed(map.geometry, map.occupancy, options);
  EXPECT_FALSE(closed.traversable({0, 2}));
  EXPECT_TRUE(closed.traversable({1, 3}));
  EXPECT_TRUE(closed.disc_is_free({2.5, 2.5}, 2.49));
  EXPECT_FALSE(closed.disc_is_free({2.5, 2.5}, 2.51));
  EXPECT_FALSE(closed.disc_is_free({-0.1, 2.5}, 0.01));
}

TEST(PlanningGrid, DiscsBesideTheMapReachIntoIt) {
  const TestMap map = map_of({"#...", "....", "...#"});
  const PlanningGrid grid(map.geometry, map.occupancy);
  // Nearest points of the obstacles: (1, 2) and (3, 1).
  EXPECT_FALSE(grid.disc_is_free({-1, 2.5}, 1.1));
  EXPECT_TRUE(grid.disc_is_free({-1, 2.5}, 0.9));
  EXPECT_FALSE(grid.disc_is_free({6, -2}, 2.9));
  EXPECT_TRUE(grid.disc_is_free({6, -2}, 2.8));
  EXPECT_TRUE(grid.disc_is_free({-9, -9}, 3));
  EXPECT_TRUE(grid.disc_is_free({9, 9}, 3));
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(grid.disc_is_free({nothing, 1}, 0.5));  // nowhere, so beside no obstacle
  EXPECT_FALSE(grid.is_free(VehicleFootprint::disc(0.5), {{nothing, 1}, 0}));
}

TEST(PlanningGrid, StepsDoNotCutCorners) {
  const TestMap map = map_of({"...", "#..", "..."});
  const PlanningGrid grid(map.geometry, map.occupancy);
  const auto allows = [&](const Cell& cell, int step) {
    return (grid.steps(map.geometry.index(cell)) >> step & 1) != 0;
  };
  EXPECT_FALSE(allows({0, 0}, 1));  // past the obstacle above it
  EXPECT_TRUE(allows({1, 0}, 1));
  EXPECT_FALSE(allows({1, 0}, 3));  // into it
  EXPECT_FALSE(allows({1, 1}, 5));
  EXPECT_TRUE(allows({1, 1}, 7));
}

TEST(PlanningGrid, LinesCostTheIntegralOfTheFactor) {
  std::mt19937_64 random(6);
  const TestMap map = random_map(random, 12, 12, 0, 0.6, 0.5);
  PlanningGridOptions options;
  options.risk_weight = 5;
  const PlanningGrid grid(map.geometry, map.occupancy, options);
  std::uniform_real_distribution<double> place(0.01, 5.99);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector2d a(place(random), place(random)), b(place(random), place(random));
    double sum = 0;
    constexpr int kParts = 20'000;
    for (int k = 0; k < kParts; ++k) {
      const Cell cell = map.geometry.cell_at(a + (k + 0.5) / kParts * (b - a));
      sum += grid.cost_factor(map.geometry.index(cell)) * (b - a).norm() / kParts;
    }
    // Each of at most 24 sides is found to a part: 24 * 3 * 8 m / 20000.
    EXPECT_NEAR(grid.line_cost(a, b), sum, 0.03);
    EXPECT_NEAR(grid.line_cost(a, b), grid.line_cost(b, a), 1e-9);
  }
  const Eigen::Vector2d point(1.1, 2.2);
  EXPECT_EQ(grid.line_cost(point, point), 0);
}

TEST(PlanningGrid, LinesThroughCornersNeedBothCells) {
  const TestMap map = map_of({"..", "#."});
  const PlanningGrid grid(map.geometry, map.occupancy);
  EXPECT_EQ(grid.line_cost({0.5, 1.5}, {1.5, 0.5}), kForbidden);
  EXPECT_NEAR(grid.line_cost({0.7, 1.5}, {1.5, 0.7}), std::sqrt(1.28), 1e-12);
  EXPECT_EQ(grid.line_cost({0.5, 1.5}, {3.5, 1.5}), kForbidden);  // off the map
}

TEST(PlanningGrid, RefusesNonsense) {
  const GridGeometry geometry{.columns = 2, .rows = 1};
  EXPECT_THROW(PlanningGrid(geometry, std::vector<double>{0}), Error);
  EXPECT_THROW(PlanningGrid(geometry, std::vector<double>{0, 1.5}), Error);
  PlanningGridOptions options;
  options.lethal_radius = -1;
  EXPECT_THROW(PlanningGrid(geometry, std::vector<double>{0, 0}, options), Error);
}

}  // namespace
}  // namespace blindcorner
