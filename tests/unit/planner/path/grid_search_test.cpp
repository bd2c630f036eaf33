// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/grid_search.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <queue>

#include "blindcorner/forward/error.h"
#include "test_maps.h"

namespace blindcorner {
namespace {

constexpr double kNoPath = std::numeric_limits<double>::infinity();

/// Costs from one cell to all by Dijkstra's algorithm, from the rules alone.
std::vector<double> brute_force_costs(const PlanningGrid& grid, const Cell& start) {
  const GridGeometry& geometry = grid.geometry();
  std::vector<double> costs(geometry.cells(), kNoPath);
  using Entry = std::pair<double, std::size_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  costs[geometry.index(start)] = 0;
  open.emplace(0, geometry.index(start));
  while (!open.empty()) {
    const auto [cost, index] = open.top();
    open.pop();
    if (cost > costs[index]) continue;
    const Cell cell = geometry.cell(index);
    for (int x = -1; x <= 1; ++x) {
      for (int y = -1; y <= 1; ++y) {
        const Cell next{cell.column + x, cell.row + y};
        if (!grid.traversable(next) || !grid.traversable({cell.column + x, cell.row}) ||
            !grid.traversable({cell.column, cell.row + y})) {
          continue;
        }
        const std::size_t to = geometry.index(next);
        const double step =
            std::hypot(x, y) * 0.5 * (grid.cost_factor(index) + grid.cost_factor(to));
        if (cost + step < costs[to]) open.emplace(costs[to] = cost + step, to);
      }
    }
  }
  return costs;
}

/// Length and cost from the cells themselves; fails where a step is not allowed.
void check_path(const PlanningGrid& grid, const CellPath& path) {
  double length = 0, cost = 0;
  for (std::size_t i = 1; i < path.cells.size(); ++i) {
    const Cell a = path.cells[i - 1], b = path.cells[i];
    ASSERT_LE(std::max(std::abs(a.column - b.column), std::abs(a.row - b.row)), 1);
    ASSERT_TRUE(grid.traversable(b) && grid.traversable({a.column, b.row}) &&
                grid.traversable({b.column, a.row}));
    const double step = std::hypot(a.column - b.column, a.row - b.row);
    length += step;
    cost +=
        0.5 * step *
        (grid.cost_factor(grid.geometry().index(a)) + grid.cost_factor(grid.geometry().index(b)));
  }
  EXPECT_NEAR(path.length, length * grid.geometry().cell_size, 1e-9);
  EXPECT_NEAR(path.cost, cost * grid.geometry().cell_size, 1e-9);
}

void compare_with_brute_force(double share, double most_risk, double risk_weight, double weight) {
  std::mt19937_64 random(7);
  GridSearch search({.heuristic_weight = weight});
  for (int repeat = 0; repeat < 60; ++repeat) {
    const TestMap map = random_map(random, 5 + repeat % 20, 3 + repeat % 13, share, most_risk);
    PlanningGridOptions options;
    options.risk_weight = risk_weight;
    const PlanningGrid grid(map.geometry, map.occupancy, options);
    std::uniform_int_distribution<std::size_t> any(0, map.geometry.cells() - 1);
    const Cell start = map.geometry.cell(any(random));
    if (!grid.traversable(start)) continue;
    const std::vector<double> costs = brute_force_costs(grid, start);
    for (std::size_t i = 0; i < map.geometry.cells(); ++i) {
      const Cell goal = map.geometry.cell(i);
      const CellPath path = search.search(grid, start, goal);
      ASSERT_EQ(path.status == PathStatus::found, std::isfinite(costs[i]));
      if (path.status != PathStatus::found) continue;
      check_path(grid, path);
      ASSERT_EQ(path.cells.front(), start);
      ASSERT_EQ(path.cells.back(), goal);
      if (weight == 1) {
        ASSERT_NEAR(path.cost, costs[i], 1e-9);
      } else {
        ASSERT_GE(path.cost, costs[i] - 1e-9);
        ASSERT_LE(path.cost, weight * costs[i] + 1e-9);
      }
    }
  }
}

TEST(GridSearch, FindsTheShortestPaths) {
  for (const double share : {0.0, 0.1, 0.3, 0.45}) compare_with_brute_force(share, 0, 0, 1);
}

TEST(GridSearch, FindsTheCheapestPathsThroughRisk) {
  for (const double weight : {0.3, 3.0, 50.0}) compare_with_brute_force(0.15, 0.6, weight, 1);
}

TEST(GridSearch, HeuristicWeightBoundsTheCost) {
  for (const double weight : {1.2, 2.0, 5.0}) {
    compare_with_brute_force(0.25, 0, 0, weight);
    compare_with_brute_force(0.15, 0.6, 3, weight);
  }
}

TEST(GridSearch, SaysWhatIsWrongWithTheEnds) {
  const TestMap map = map_of({"..#..", ".####", "..#.."});
  const PlanningGrid grid(map.geometry, map.occupancy);
  GridSearch search;
  EXPECT_EQ(search.search(grid, {0, 0}, {4, 0}).status, PathStatus::no_path);
  EXPECT_EQ(search.search(grid, {2, 0}, {0, 0}).status, PathStatus::start_blocked);
  EXPECT_EQ(search.search(grid, {0, 0}, {2, 0}).status, PathStatus::goal_blocked);
  EXPECT_EQ(search.search(grid, {-1, 0}, {9, 9}).status, PathStatus::start_outside);
  EXPECT_EQ(search.search(grid, {0, 0}, {9, 9}).status, PathStatus::goal_outside);
  EXPECT_EQ(path_status_word(PathStatus::goal_blocked), "goal_blocked");
}

TEST(GridSearch, StartMayBeTheGoal) {
  const TestMap map = map_of({"..", ".."});
  const PlanningGrid grid(map.geometry, map.occupancy);
  const CellPath path = GridSearch().search(grid, {1, 1}, {1, 1});
  EXPECT_EQ(path.status, PathStatus::found);
  EXPECT_EQ(path.cells, std::vector<Cell>(1, Cell{1, 1}));
  EXPECT_EQ(path.length, 0);
  EXPECT_EQ(path.cost, 0);
}

TEST(GridSearch, PassesACorridorOfOneCell) {
  const TestMap map = map_of({"#########", "#.......#", "#######.#", "........#", "#########"});
  const PlanningGrid grid(map.geometry, map.occupancy);
  const CellPath path = GridSearch().search(grid, {1, 3}, {0, 1});
  EXPECT_EQ(path.status, PathStatus::found);
  EXPECT_DOUBLE_EQ(path.length, 15);  // no corner is cut
}

TEST(GridSearch, GridsOfAnotherSizeMayFollow) {
  GridSearch search;
  for (const int size : {40, 7, 90}) {
    const GridGeometry geometry{.columns = size, .rows = size, .cell_size = 0.5};
    const PlanningGrid grid(geometry, std::vector<double>(geometry.cells(), 0));
    const CellPath path = search.search(grid, {0, 0}, {size - 1, size - 1});
    EXPECT_NEAR(path.length, 0.5 * (size - 1) * std::sqrt(2.0), 1e-9);
  }
}

TEST(GridSearch, RefusesWeightsBelowOne) {
  EXPECT_THROW(GridSearch({.heuristic_weight = 0.9}), Error);
}

TEST(GridSearch, CostsToAGoalAreThoseOfSearches) {
  std::mt19937_64 random(5);
  for (int repeat = 0; repeat < 6; ++repeat) {
    const TestMap map = random_map(random, 20, 15, 0.2, repeat % 2 == 0 ? 0 : 0.6, 0.5);
    PlanningGridOptions options;
    options.risk_weight = 3;
    const PlanningGrid grid(map.geometry, map.occupancy, options);
    GridSearch search;
    const std::vector<Cell> goals{{19, 14}, {3, 7}};
    const std::vector<double> costs = search.costs_to(grid, goals);
    for (std::size_t i = 0; i < costs.size(); i += 7) {
      double least = std::numeric_limits<double>::infinity();
      for (const Cell& goal : goals) {
        const CellPath path = search.search(grid, map.geometry.cell(i), goal);
        if (path.status == PathStatus::found) least = std::min(least, path.cost);
      }
      if (std::isinf(least)) {
        EXPECT_EQ(costs[i], least);
      } else {
        EXPECT_NEAR(costs[i], least, 1e-4 * (1 + least));
      }
    }
  }
}

}  // namespace
}  // namespace blindcorner
