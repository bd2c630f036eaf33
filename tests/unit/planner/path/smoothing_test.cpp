// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/smoothing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/planner/path/path_planner.h"
#include "planner/path/spline.h"
#include "test_maps.h"

namespace blindcorner {
namespace {

double greatest_curvature(const Path& path) {
  double most = 0;
  for (const PathPoint& p : path.points) most = std::max(most, std::abs(p.curvature));
  return most;
}

/// What every path promises: its own points agree with each other.
void check_points(const Path& path) {
  ASSERT_FALSE(path.points.empty());
  EXPECT_EQ(path.points.front().arc_length, 0);
  EXPECT_DOUBLE_EQ(path.points.back().arc_length, path.length);
  for (std::size_t i = 1; i < path.points.size(); ++i) {
    const PathPoint &a = path.points[i - 1], &b = path.points[i];
    const double chord = (b.position - a.position).norm();
    ASSERT_GT(b.arc_length, a.arc_length);
    ASSERT_GE(b.arc_length - a.arc_length, chord - 1e-9);
    ASSERT_TRUE(std::isfinite(b.heading));
  }
}

TEST(Spline, BeginsAndEndsAtItsControlPoints) {
  const std::vector<Eigen::Vector2d> control{{0, 0}, {1, 1}, {2, 0}, {4, 1}, {4, 3}};
  const std::vector<CubicBezier> pieces = spline_pieces(control);
  ASSERT_EQ(pieces.size(), 4U);
  EXPECT_NEAR((pieces.front().point(0) - control.front()).norm(), 0, 1e-15);
  EXPECT_NEAR((pieces.back().point(1) - control.back()).norm(), 0, 1e-14);
  EXPECT_NEAR(pieces.front().heading(0), kPi / 4, 1e-12);
  EXPECT_NEAR(pieces.front().curvature(0), 0, 1e-12);
  for (std::size_t i = 1; i < pieces.size(); ++i) {
    EXPECT_NEAR((pieces[i - 1].point(1) - pieces[i].point(0)).norm(), 0, 1e-14);
    EXPECT_NEAR(pieces[i - 1].heading(1), pieces[i].heading(0), 1e-12);
    EXPECT_NEAR(pieces[i - 1].curvature(1), pieces[i].curvature(0), 1e-12);
  }
}

TEST(Spline, SubdividedIsTheSameCurve) {
  const std::vector<Eigen::Vector2d> control{{0, 0}, {1, 1}, {2, 0}, {4, 1}, {4, 3}};
  const Eigen::Vector2d bend(-0.3, 0.6);
  const std::vector<CubicBezier> whole = spline_pieces(control, bend);
  const std::vector<CubicBezier> halves = spline_pieces(subdivided(control, bend), bend / 4);
  ASSERT_EQ(halves.size(), 2 * whole.size());
  for (std::size_t k = 0; k < whole.size(); ++k) {
    for (const double t : {0.0, 0.3, 0.8}) {
      EXPECT_NEAR((halves[2 * k].point(t) - whole[k].point(t / 2)).norm(), 0, 1e-14);
      EXPECT_NEAR((halves[2 * k + 1].point(t) - whole[k].point((1 + t) / 2)).norm(), 0, 1e-14);
    }
  }
  EXPECT_NEAR((whole.front().second_derivative(0) - bend).norm(), 0, 1e-12);
}

TEST(Spline, FlattenedPointsAreTheLeastSquares) {
  // At the minimum the gradient is zero: D'D p + w (p - q), D the second differences.
  const std::vector<Eigen::Vector2d> q{{0, 0}, {1, 2}, {2, -1}, {3, 5}, {4, 0}, {5, 1}};
  const std::vector<double> w{1e3, 0.2, 0.01, 3, 0.5, 1e3};
  const std::vector<Eigen::Vector2d> p = flattened(q, w);
  std::vector<Eigen::Vector2d> gradient(q.size());
  for (std::size_t i = 0; i < q.size(); ++i) gradient[i] = w[i] * (p[i] - q[i]);
  for (std::size_t i = 1; i + 1 < q.size(); ++i) {
    const Eigen::Vector2d second = p[i - 1] - 2 * p[i] + p[i + 1];
    gradient[i - 1] += second;
    gradient[i] -= 2 * second;
    gradient[i + 1] += second;
  }
  for (const Eigen::Vector2d& g : gradient) EXPECT_NEAR(g.norm(), 0, 1e-10);
}

TEST(Spline, PointsAreEvenlySpacedAlongLines) {
  const std::vector<Eigen::Vector2d> corners{{0, 0}, {0, 0}, {3, 0}, {3, 1}};
  const std::vector<Eigen::Vector2d> points = evenly_spaced(corners, 9);
  ASSERT_EQ(points.size(), 9U);
  EXPECT_NEAR((points[5] - Eigen::Vector2d(2.5, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((points[7] - Eigen::Vector2d(3, 0.5)).norm(), 0, 1e-12);
  EXPECT_EQ(points.back(), corners.back());
}

TEST(Shortcut, StraightensWhatIsFree) {
  const TestMap map = map_of({"......", "......", "......"});
  const PlanningGrid grid(map.geometry, map.occupancy);
  const std::vector<Eigen::Vector2d> points{{0.5, 0.5}, {1.5, 1.5}, {2.5, 1.5}, {5.5, 1.5}};
  const std::vector<Eigen::Vector2d> corners = shortcut(grid, points);
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
    std::vector<Eigen::Vector2d> points;
    for (const Cell& cell : path.cells) points.push_back(map.geometry.center(cell));
    const std::vector<Eigen::Vector2d> corners = shortcut(grid, points);
    double cost = 0;
    for (std::size_t i = 1; i < corners.size(); ++i) {
      cost += grid.line_cost(corners[i - 1], corners[i]);
    }
    EXPECT_LE(cost, path.cost * (1 + 1e-6));
  }
}

TEST(Smooth, ACornerIsTakenWithTheTurningRadius) {
  const GridGeometry geometry{.columns = 200, .rows = 200, .cell_size = 0.2};
  const PlanningGrid grid(geometry, std::vector<double>(geometry.cells(), 0));
  SmoothingOptions options;
  options.footprint = VehicleFootprint::rectangle(4.5, 1.8);
  options.min_turning_radius = 5.5;
  for (const double degrees : {10.0, 45.0, 90.0, 120.0}) {
    const Eigen::Vector2d corner(20, 15);
    const Eigen::Vector2d out(std::cos(degrees * kDegree), std::sin(degrees * kDegree));
    const std::vector<Eigen::Vector2d> corners{{4, 15}, corner, corner + 15 * out};
    const Path path = smooth(grid, corners, {0.0, degrees * kDegree}, options);
    check_points(path);
    EXPECT_FALSE(path.flags.curvature_exceeded) << degrees;
    EXPECT_FALSE(path.flags.partly_unsmoothed) << degrees;
    EXPECT_LE(greatest_curvature(path), 1.001 / 5.5 + 1e-12) << degrees;
    EXPECT_NEAR(path.points.front().heading, 0, 1e-9);
    EXPECT_NEAR(path.points.back().heading, degrees * kDegree, 1e-9);
    EXPECT_LE((path.points.back().position - corners.back()).norm(), 1e-9);
  }
}

TEST(Smooth, DegenerateWaypointsAreDefined) {
  const GridGeometry geometry{.columns = 100, .rows = 100, .cell_size = 0.1};
  const PlanningGrid grid(geometry, std::vector<double>(geometry.cells(), 0));
  SmoothingOptions options;
  options.min_turning_radius = 1;
  const Eigen::Vector2d a(2, 3), b(7, 3);
  const Path point = smooth(grid, std::vector<Eigen::Vector2d>{a, a, a}, {}, options);
  EXPECT_EQ(point.points.size(), 1U);
  EXPECT_EQ(point.length, 0);
  EXPECT_EQ(point.at(1).position, a);
  EXPECT_EQ(point.nearest(b), 0);
  for (const auto& corners : {std::vector<Eigen::Vector2d>{a, a, b, b},
                              std::vector<Eigen::Vector2d>{a, a + 0.3 * (b - a), b},
                              std::vector<Eigen::Vector2d>{a, b}}) {
    const Path line = smooth(grid, corners, {}, options);
    check_points(line);
    EXPECT_NEAR(line.length, 5, 1e-6);
    EXPECT_LT(greatest_curvature(line), 1e-6);
    EXPECT_FALSE(line.flags.curvature_exceeded);
  }
  const Path tiny =
      smooth(grid, std::vector<Eigen::Vector2d>{a, a + Eigen::Vector2d(1e-6, 0)}, {}, options);
  EXPECT_NEAR(tiny.length, 1e-6, 1e-12);
  EXPECT_THROW(smooth(grid, {}, {}, options), Error);
}

TEST(Smooth, SaysThatAHeadingCannotBeMet) {
  const GridGeometry geometry{.columns = 100, .rows = 100, .cell_size = 0.1};
  const PlanningGrid grid(geometry, std::vector<double>(geometry.cells(), 0));
  SmoothingOptions options;
  options.min_turning_radius = 4;
  const std::vector<Eigen::Vector2d> corners{{4, 5}, {6, 5}};
  EXPECT_TRUE(smooth(grid, corners, {kPi, 0.0}, options).flags.curvature_exceeded);
}

TEST(Smooth, BeginsWithTheCurvatureThatIsDriven) {
  const GridGeometry geometry{.columns = 100, .rows = 100, .cell_size = 0.5};
  const PlanningGrid grid(geometry, std::vector<double>(geometry.cells(), 0));
  SmoothingOptions options;
  options.min_turning_radius = 4;
  const std::vector<Eigen::Vector2d> corners{{10, 10}, {30, 14}, {40, 40}};
  for (const double curvature : {-0.12, 0.0, 0.2}) {
    const Path path = smooth(grid, corners, {0.3, {}, curvature}, options);
    EXPECT_FALSE(path.flags.curvature_exceeded) << curvature;
    EXPECT_NEAR((path.pieces.front().point(0) - corners.front()).norm(), 0, 1e-12);
    EXPECT_NEAR(path.points.front().heading, 0.3, 1e-12);
    EXPECT_NEAR(path.points.front().curvature, curvature, 1e-12);
    check_points(path);
  }
}

/// Denser than what the smoother itself looks at, which may miss 1/500 of a cell.
bool collides(const PlanningGrid& grid, const VehicleFootprint& footprint, const Path& path) {
  const double cell = grid.geometry().cell_size;
  const double radius = std::max(0.0, footprint.disc_radius() - 0.01 * cell);
  for (const CubicBezier& piece : path.pieces) {
    const int samples = 1 + static_cast<int>(40 * piece.length() / cell);
    for (int i = 0; i <= samples; ++i) {
      const double t = static_cast<double>(i) / samples, heading = piece.heading(t);
      for (const double offset : footprint.disc_offsets()) {
        const Eigen::Vector2d ahead(std::cos(heading), std::sin(heading));
        if (!grid.disc_is_free(piece.point(t) + offset * ahead, radius)) return true;
      }
    }
  }
  return false;
}

TEST(PathPlanner, PathsOfDiscsNeverCollide) {
  std::mt19937_64 random(9);
  int found = 0;
  for (int repeat = 0; repeat < 150; ++repeat) {
    const TestMap map = blocks_map(random, 80, 0.1, 14, 16);
    PathPlannerOptions options;
    options.smoothing.footprint = VehicleFootprint::disc(0.2);
    options.smoothing.min_turning_radius = repeat % 3 == 0 ? 0 : 0.3;
    options.grid.risk_weight = repeat % 2;
    PathPlanner planner(options);
    const PlanningGrid grid = planner.grid(map.geometry, map.occupancy);
    const Path path = planner.plan(grid, {{0.5, 0.5}, {}, {7.5, 7.5}, {}});
    if (!path.found()) continue;
    ++found;
    check_points(path);
    EXPECT_FALSE(path.flags.footprint_collides);
    EXPECT_FALSE(collides(grid, options.smoothing.footprint, path)) << repeat;
    if (options.smoothing.min_turning_radius > 0 && !path.flags.curvature_exceeded) {
      EXPECT_LE(greatest_curvature(path), 1.002 / 0.3);
    }
  }
  EXPECT_GT(found, 100);
}

TEST(PathPlanner, PathsOfCarsCollideOnlyWhereTheySay) {
  std::mt19937_64 random(10);
  int found = 0, fine = 0;
  for (int repeat = 0; repeat < 60; ++repeat) {
    const TestMap map = blocks_map(random, 120, 0.5, 18, 14);
    const PathPlannerOptions options = PathPlannerOptions::car();
    PathPlanner planner(options);
    const PlanningGrid grid = planner.grid(map.geometry, map.occupancy);
    const Path path = planner.plan(grid, {{4, 4}, {}, {56, 56}, {}});
    if (!path.found()) continue;
    ++found;
    check_points(path);
    if (!path.flags.footprint_collides) {
      EXPECT_FALSE(collides(grid, options.smoothing.footprint, path)) << repeat;
    }
    if (!path.flags.curvature_exceeded) {
      EXPECT_LE(greatest_curvature(path), 1.002 / 5.5);
    }
    fine += !path.flags.footprint_collides && !path.flags.curvature_exceeded ? 1 : 0;
  }
  EXPECT_GT(found, 30);
  RecordProperty("found", found);
  RecordProperty("fine", fine);
  EXPECT_GT(fine, found / 2);  // the others are tight and say so
}

TEST(PathPlanner, PassesACorridorOfOneCell) {
  const TestMap map = map_of({"#########", "#.......#", "#######.#", "........#", "#########"});
  PathPlannerOptions options;
  options.smoothing.footprint = VehicleFootprint::disc(0.45);
  PathPlanner planner(options);
  const PlanningGrid grid = planner.grid(map.geometry, map.occupancy);
  const Path path = planner.plan(grid, {{1.5, 3.5}, {}, {0.5, 1.5}, {}});
  ASSERT_TRUE(path.found());
  EXPECT_FALSE(path.flags.footprint_collides);
  EXPECT_FALSE(collides(grid, options.smoothing.footprint, path));
  // A disc that touches both walls has to turn on the spot, which is said.
  options.smoothing.footprint = VehicleFootprint::disc(0.5);
  const Path tight = PathPlanner(options).plan(grid, {{1.5, 3.5}, {}, {0.5, 1.5}, {}});
  ASSERT_TRUE(tight.found());
  EXPECT_TRUE(tight.flags.partly_unsmoothed);
  EXPECT_FALSE(tight.flags.footprint_collides);
  options.smoothing.footprint = VehicleFootprint::disc(0.51);
  PathPlanner wide(options);
  const PlanningGrid closed = wide.grid(map.geometry, map.occupancy);
  EXPECT_EQ(wide.plan(closed, {{1.5, 3.5}, {}, {0.5, 1.5}, {}}).status, PathStatus::start_blocked);
}

TEST(PathPlanner, SaysWhereACarCannotTurnToItsPath) {
  // 4 m wide, 4.5 x 1.8 m, 5.5 m: the car leaves a heading of 30 degrees in no free curve.
  TestMap map;
  map.geometry = {.columns = 160, .rows = 24, .cell_size = 0.25};
  for (std::size_t i = 0; i < map.geometry.cells(); ++i) {
    const double y = map.geometry.center(map.geometry.cell(i)).y();
    map.occupancy.push_back(y < 1 || y > 5 ? 1 : 0);
  }
  for (const double degrees : {30.0, 150.0, -90.0}) {
    PathPlanner planner(PathPlannerOptions::car());
    const PlanningGrid grid = planner.grid(map.geometry, map.occupancy);
    const Path path = planner.plan(grid, {{5, 3}, degrees * kDegree, {35, 3}, {}});
    ASSERT_TRUE(path.found());
    EXPECT_TRUE(path.flags.curvature_exceeded) << degrees;
    EXPECT_GT(path.greatest_curvature, 1.05 / 5.5) << degrees;
    const Path to = planner.plan(grid, {{5, 3}, {}, {35, 3}, degrees * kDegree});
    EXPECT_TRUE(to.flags.curvature_exceeded) << degrees;
    // The diagonal of the car, 4.8 m, is longer than the corridor is wide.
    EXPECT_TRUE(degrees == 30 || path.flags.footprint_collides) << degrees;
  }
}

TEST(PathPlanner, CornersOfStraightLinesHaveACurvature) {
  const TestMap map = map_of({"#########", "#.......#", "#######.#", "#######.#", "#########"});
  PathPlannerOptions options;
  options.smoothing.footprint = VehicleFootprint::disc(0.5);
  PathPlanner planner(options);
  const PlanningGrid grid = planner.grid(map.geometry, map.occupancy);
  const Path path = planner.plan(grid, {{1.5, 3.5}, {}, {7.5, 1.5}, {}});
  ASSERT_TRUE(path.found());
  ASSERT_TRUE(path.flags.partly_unsmoothed);
  check_points(path);
  double turned = 0;  // the integral of the curvature is the turn
  for (std::size_t i = 1; i < path.points.size(); ++i) {
    const PathPoint &a = path.points[i - 1], &b = path.points[i];
    turned += 0.5 * (a.curvature + b.curvature) * (b.arc_length - a.arc_length);
  }
  EXPECT_NEAR(turned, -kPi / 2, 1e-9);
  EXPECT_NEAR(greatest_curvature(path), kPi / 2 / 0.5, 1e-9);
}

TEST(Smooth, LooksForCollisionsWhateverTheSpacingOfPoints) {
  // A post of one cell stands in the way, between points 4 m apart.
  TestMap map;
  map.geometry = {.columns = 100, .rows = 20, .cell_size = 0.2};
  map.occupancy.assign(map.geometry.cells(), 0);
  for (int row = 0; row < 20; ++row) map.occupancy[map.geometry.index({44, row})] = 1;
  const PlanningGrid grid(map.geometry, map.occupancy);
  SmoothingOptions options;
  options.footprint = VehicleFootprint::disc(0.3);
  options.point_spacing = 4;
  const std::vector<Eigen::Vector2d> line{{1, 2}, {19, 2}};
  EXPECT_TRUE(smooth(grid, line, {}, options).flags.footprint_collides);
}

TEST(PathPlanner, StartsWhereTheVehicleIsFreeThoughItsCellIsNot) {
  const TestMap map = map_of({"....", "....", "####"});
  PathPlannerOptions options;
  options.smoothing.footprint = VehicleFootprint::disc(0.6);
  PathPlanner planner(options);
  const PlanningGrid grid = planner.grid(map.geometry, map.occupancy);
  EXPECT_FALSE(grid.traversable({0, 1}));
  const Path path = planner.plan(grid, {{0.5, 1.7}, {}, {3.5, 1.7}, {}});
  ASSERT_TRUE(path.found());
  EXPECT_EQ(path.points.front().position, Eigen::Vector2d(0.5, 1.7));
  EXPECT_FALSE(collides(grid, options.smoothing.footprint, path));
  EXPECT_EQ(planner.plan(grid, {{0.5, 1.5}, {}, {3.5, 1.7}, {}}).status, PathStatus::start_blocked);
}

TEST(PathPlanner, StartMayBeTheGoal) {
  const TestMap map = map_of({"...", "...", "..."});
  PathPlanner planner;
  const PlanningGrid grid = planner.grid(map.geometry, map.occupancy);
  const Path path = planner.plan(grid, {{1.2, 1.3}, 0.7, {1.2, 1.3}, {}});
  ASSERT_TRUE(path.found());
  EXPECT_EQ(path.points.size(), 1U);
  EXPECT_EQ(path.points[0].heading, 0.7);
  EXPECT_EQ(path.length, 0);
}

TEST(PathPlanner, TellsWhyThereIsNoPath) {
  const TestMap map = map_of({"..#..", "..#..", "..#.."});
  PathPlanner planner;
  const PlanningGrid grid = planner.grid(map.geometry, map.occupancy);
  const auto status = [&](const Eigen::Vector2d& start, const Eigen::Vector2d& goal) {
    const Path path = planner.plan(grid, {start, {}, goal, {}});
    EXPECT_TRUE(path.points.empty());
    return path.status;
  };
  EXPECT_EQ(status({0.5, 0.5}, {4.5, 0.5}), PathStatus::no_path);
  EXPECT_EQ(status({2.5, 0.5}, {4.5, 0.5}), PathStatus::start_blocked);
  EXPECT_EQ(status({0.5, 0.5}, {2.5, 0.5}), PathStatus::goal_blocked);
  EXPECT_EQ(status({0.5, 0.5}, {1e300, 0.5}), PathStatus::goal_outside);
  EXPECT_EQ(status({-0.5, 0.5}, {4.5, 0.5}), PathStatus::start_outside);
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(planner.plan(grid, {{nothing, 0}, {}, {1, 1}, {}}), Error);
  EXPECT_THROW(planner.plan(grid, {{0.5, 0.5}, 0.0, {1.5, 0.5}, {}, nothing}), Error);
}

}  // namespace
}  // namespace blindcorner
