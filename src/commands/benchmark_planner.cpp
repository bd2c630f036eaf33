// SPDX-License-Identifier: Apache-2.0
/// `blindcorner benchmark planner`: problems with a published shortest path, and how much time a
/// longer path saves.
#include <tbb/task_arena.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>
#include <numeric>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/movingai.h"
#include "blindcorner/planner/path/path_planner.h"
#include "commands/benchmark.h"
#include "commands/cpu_clock.h"
#include "commands/progress.h"
#include "forward/support/quantile.h"
#include "planner/path/turning_path.h"
#include "report/formatted.h"

namespace blindcorner {
namespace {

/// A length meets its optimum within this, cells, or within the rounding of the file if that is
/// larger. Lengths that need the rounding are counted apart.
constexpr double kTolerance = 1e-3;
/// The run time is judged by this many problems, the longest ones.
constexpr std::size_t kLongest = 100;

struct PlannerArguments : StudyArguments {
  std::string map, scenario;
  std::vector<double> weights{1, 1.5, 2, 3, 4, 5};
};

/// The length of a path in cells (NaN: none was found), and the work that it took.
struct Solution {
  double length = std::numeric_limits<double>::quiet_NaN();
  double time = 0;  ///< ms of one processor
  std::size_t expansions = 0;
};

struct Problems {
  std::vector<MovingAiProblem> all;
  std::vector<std::size_t> longest;  ///< by their optimum
};

/// One way to plan, with its solutions of all problems in the file's order.
struct Variant {
  std::string name;
  const Problems* problems = nullptr;
  std::vector<Solution> solutions{};

  auto unsolved() const {
    return std::ranges::count_if(solutions, [](const auto& s) { return std::isnan(s.length); });
  }
  /// Values of the longest problems and their solutions. Problems without a path, and values that
  /// are not finite, are left out.
  std::vector<double> of_longest(double (*value)(const MovingAiProblem&, const Solution&)) const {
    std::vector<double> values;
    for (const std::size_t i : problems->longest) {
      const double v = value(problems->all[i], solutions[i]);
      if (std::isfinite(solutions[i].length) && std::isfinite(v)) values.push_back(v);
    }
    return values;
  }
};

/// A grid whose cells are squares of `factor` by `factor` cells of another grid. Each is as
/// occupied as its most occupied cell, so what is free on the coarse grid is free on the fine one.
PlanningGrid coarser(const GridGeometry& fine, const std::vector<double>& occupancy, int factor) {
  GridGeometry coarse = fine;
  coarse.columns = (fine.columns + factor - 1) / factor;
  coarse.rows = (fine.rows + factor - 1) / factor;
  coarse.cell_size = factor * fine.cell_size;
  std::vector<double> worst(coarse.cells(), 0.0);
  for (std::size_t i = 0; i < occupancy.size(); ++i) {
    const Cell cell = fine.cell(i);
    double& value = worst[coarse.index({cell.column / factor, cell.row / factor})];
    value = std::max(value, occupancy[i]);
  }
  return PlanningGrid(coarse, worst);
}

/// The grid that a problem is to be solved on: that of the terrain on which it starts. A cell of
/// the grid is `factor` by `factor` cells of the map.
class TerrainGrids {
 public:
  explicit TerrainGrids(const MovingAiMap& map, int factor = 1) : map_(map), factor_(factor) {}

  const PlanningGrid& of(const MovingAiProblem& problem) {
    const Terrain terrain = map_.terrain[map_.geometry.index(problem.start)];
    const Terrain free = terrain == Terrain::water ? Terrain::water : Terrain::ground;
    const auto found = grids_.find(free);
    if (found != grids_.end()) return found->second;
    return grids_.emplace(free, coarser(map_.geometry, map_.occupancy(free), factor_))
        .first->second;
  }

 private:
  const MovingAiMap& map_;
  int factor_;
  std::map<Terrain, PlanningGrid> grids_;
};

/// Solves all problems in one way. `solve(grid, problem)` gives the length and the expansions.
template <typename Solve>
Variant solve_all(const Problems& problems, TerrainGrids& grids, const std::string& name,
                  Solve solve) {
  Variant variant{name, &problems};
  Progress progress(name, problems.all.size());
  tbb::task_arena one_thread(1);  // whose processor time is measured
  for (const MovingAiProblem& problem : problems.all) {
    const PlanningGrid& grid = grids.of(problem);
    const double begin = cpu_seconds();
    Solution solution = one_thread.execute([&] { return solve(grid, problem); });
    solution.time = 1e3 * (cpu_seconds() - begin);
    variant.solutions.push_back(solution);
    progress.advance();
  }
  return variant;
}

void search_all(const PlannerArguments& arguments, const Problems& problems, TerrainGrids& grids,
                StudyRun<Variant>& run) {
  for (const double weight : arguments.weights) {
    GridSearch search({.heuristic_weight = weight});
    run.add(
        solve_all(problems, grids, formatted("A*, weight %g", weight),
                  [&](const PlanningGrid& grid, const MovingAiProblem& problem) {
                    const CellPath path = search.search(grid, problem.start, problem.goal);
                    if (path.status != PathStatus::found)
                      return Solution{.expansions = path.expansions};
                    return Solution{path.length / grid.geometry().cell_size, 0, path.expansions};
                  }));
  }
}

/// Paths for a point, of straight lines at any angle instead of steps between cells: with rounded
/// corners and without.
void smooth_all(const Problems& problems, TerrainGrids& grids, StudyRun<Variant>& run) {
  PathPlanner planner;
  const auto request = [](const PlanningGrid& grid, const MovingAiProblem& problem) {
    return PathRequest{.start = grid.geometry().center(problem.start),
                       .start_heading = {},
                       .goal = {grid.geometry().center(problem.goal), {}, {}}};
  };
  run.add(solve_all(problems, grids, "rounded", [&](const PlanningGrid& grid, const auto& problem) {
    const Path path = planner.plan(grid, request(grid, problem));
    if (!path.found()) return Solution{.expansions = path.expansions};
    return Solution{path.length / grid.geometry().cell_size, 0, path.expansions};
  }));
  GridSearch search;
  run.add(
      solve_all(problems, grids, "any-angle", [&](const PlanningGrid& grid, const auto& problem) {
        const CellPath cells = search.search(grid, problem.start, problem.goal);
        if (cells.status != PathStatus::found) return Solution{.expansions = cells.expansions};
        std::vector<Eigen::Vector2d> points;
        for (const Cell& cell : cells.cells) points.push_back(grid.geometry().center(cell));
        points = shortcut(grid, points);
        double length = 0;
        for (std::size_t i = 1; i < points.size(); ++i) {
          length += (points[i] - points[i - 1]).norm();
        }
        return Solution{length / grid.geometry().cell_size, 0, cells.expansions};
      }));
}

/// Searches on larger cells. A problem has no path if its ends lie in cells that are not all free,
/// or if its only passages are narrower than two cells. The ways to the centre of the first cell
/// and from that of the last one count.
void search_coarser(const MovingAiMap& map, const Problems& problems, StudyRun<Variant>& run) {
  for (const int factor : {2, 4}) {
    TerrainGrids grids(map, factor);
    GridSearch search;
    run.add(solve_all(
        problems, grids, formatted("cells of %d", factor),
        [&](const PlanningGrid& grid, const MovingAiProblem& problem) {
          const Eigen::Vector2d from = map.geometry.center(problem.start);
          const Eigen::Vector2d to = map.geometry.center(problem.goal);
          const GridGeometry& cells = grid.geometry();
          const CellPath path = search.search(grid, cells.cell_at(from), cells.cell_at(to));
          if (path.status != PathStatus::found) return Solution{.expansions = path.expansions};
          const double ends = (cells.center(path.cells.front()) - from).norm() +
                              (cells.center(path.cells.back()) - to).norm();
          return Solution{(path.length + ends) / map.geometry.cell_size, 0, path.expansions};
        }));
  }
}

bool met(const MovingAiProblem& problem, const Solution& solution) {
  return std::abs(solution.length - problem.length) <= std::max(kTolerance, problem.rounding);
}

std::vector<std::size_t> longest_problems(const std::vector<MovingAiProblem>& problems) {
  std::vector<std::size_t> order(problems.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(
      order, [&](std::size_t a, std::size_t b) { return problems[a].length > problems[b].length; });
  order.resize(std::min(order.size(), kLongest));
  return order;
}

double ratio_of(const MovingAiProblem& problem, const Solution& solution) {
  return problem.length > 0 ? solution.length / problem.length
                            : std::numeric_limits<double>::quiet_NaN();
}
double time_of(const MovingAiProblem& /*problem*/, const Solution& solution) {
  return solution.time;
}
double expansions_of(const MovingAiProblem& /*problem*/, const Solution& solution) {
  return static_cast<double>(solution.expansions);
}

std::string csv(const std::vector<Variant>& variants) {
  std::string text = "problem,bucket,optimum_cells,variant,length_cells,time_ms,expansions\n";
  for (const Variant& variant : variants) {
    const std::vector<MovingAiProblem>& problems = variant.problems->all;
    std::string name = variant.name;
    std::erase(name, ',');
    for (std::size_t i = 0; i < problems.size(); ++i) {
      const Solution& s = variant.solutions[i];
      text += formatted("%zu,%d,%.8f,%s,", i, problems[i].bucket, problems[i].length, name.c_str());
      text += std::isnan(s.length) ? "" : formatted("%.8f", s.length);
      text += formatted(",%.4f,%zu\n", s.time, s.expansions);
    }
  }
  return text;
}

std::vector<Chart> charts(const std::vector<Variant>& variants) {
  Chart trade{"the longest problems: medians", "planning time, ms", "length over optimum"};
  Chart each{"the longest problems, each", "planning time, ms", "length over optimum"};
  Chart time{"all problems", "optimum, cells", "planning time, ms"};
  for (const Variant& variant : variants) {
    // A variant that solves none of the longest problems has no medians.
    const std::vector<double> times = variant.of_longest(time_of);
    if (!times.empty()) {
      trade.series.push_back({variant.name,
                              {{median(times), median(variant.of_longest(ratio_of)), variant.name}},
                              SeriesStyle::circles});
    }
    ChartSeries dots{variant.name, {}, SeriesStyle::dots};
    for (const std::size_t i : variant.problems->longest) {
      dots.points.push_back(
          {variant.solutions[i].time, ratio_of(variant.problems->all[i], variant.solutions[i])});
    }
    each.series.push_back(std::move(dots));
  }
  constexpr std::size_t kMaxDots = 1000;
  for (const Variant* variant : {&variants.front(), &variants.back()}) {
    ChartSeries dots{variant->name, {}, SeriesStyle::dots};
    const std::vector<MovingAiProblem>& problems = variant->problems->all;
    const std::size_t step = 1 + problems.size() / kMaxDots;
    for (std::size_t i = 0; i < problems.size(); i += step) {
      dots.points.push_back({problems[i].length, variant->solutions[i].time});
    }
    time.series.push_back(std::move(dots));
  }
  std::vector<Chart> list{trade, each, time};
  for (Chart& chart : list) chart.width = 560, chart.height = 380;
  return list;
}

TableRow row_of(const Variant& v) {
  return {{{"", "way to plan", "%-16s", v.name},
           {"", "unsolved", "%8d", v.unsolved()},
           {"", "length", "%9.4f", median(v.of_longest(ratio_of))},
           {"", "90 %", "%9.4f", quantile(v.of_longest(ratio_of), 0.9)},
           {"", "longest", "%9.4f", quantile(v.of_longest(ratio_of), 1)},
           {"", "ms", "%9.2f", median(v.of_longest(time_of))},
           {"", "90 %", "%9.2f", quantile(v.of_longest(time_of), 0.9)},
           {"", "expansions", "%12.0f", median(v.of_longest(expansions_of))}}};
}

const Study<Variant> kPlannerStudy{
    "planner",
    "Paths of published problems",
    "Problems of the MovingAI benchmark, one after the other. Time is that of one processor for "
    "everything a new problem costs on a known map. Weights multiply the heuristic: the path is at "
    "most that much longer than the optimum. Cells of 2 and 4: those of the map joined to squares, "
    "free where all of them are. Any-angle: straight lines in place of steps between "
    "cells. Rounded: the same with rounded corners. Both can be "
    "shorter than the optimum, which moves between centres of neighbouring cells. Columns after "
    "the "
    "second: of the longest problems.",
    row_of,
    charts,
    csv};

int run_planner(const PlannerArguments& arguments) {
  const MovingAiMap map = read_movingai_map(arguments.map);
  Problems problems{read_movingai_scenario(arguments.scenario, map.geometry), {}};
  problems.longest = longest_problems(problems.all);
  TerrainGrids grids(map);
  StudyRun run(kPlannerStudy, arguments);
  search_all(arguments, problems, grids, run);
  search_coarser(map, problems, run);
  smooth_all(problems, grids, run);
  run.end();
  const std::vector<Solution>& optimal = run.units().front().solutions;
  std::size_t count = 0, rounded = 0;
  double greatest = 0;  // difference of those that met their optimum, cells
  for (std::size_t i = 0; i < problems.all.size(); ++i) {
    if (met(problems.all[i], optimal[i])) {
      const double difference = std::abs(optimal[i].length - problems.all[i].length);
      ++count;
      rounded += difference > kTolerance ? 1 : 0;
      greatest = std::max(greatest, difference);
      continue;
    }
    std::fprintf(stderr, "blindcorner: problem %zu: found %.8f cells, published: %.8f\n", i,
                 optimal[i].length, problems.all[i].length);
  }
  arguments.out.text(
      "%zu of %zu problems met their optimum: %zu within %g cells, %zu only within the rounding of "
      "the file's lengths; largest difference: %.4f cells\n",
      count, problems.all.size(), count - rounded, kTolerance, rounded, greatest);
  return count == problems.all.size() ? kAllWell : kSomeFailed;
}

}  // namespace

void add_planner_benchmark(CLI::App& benchmark, int& exit_code) {
  CLI::App& command = *benchmark.add_subcommand(
      "planner",
      "all problems of a MovingAI scenario against their published optima; writes planner.csv and "
      "planner.html. Exit code 1: an optimum was missed");
  const auto arguments = std::make_shared<PlannerArguments>();
  command.add_option("--map", arguments->map, "MovingAI map (.map)")->required();
  command.add_option("--scenario", arguments->scenario, "its problems (.map.scen)")->required();
  command.add_option("-o,--output", arguments->output, "directory to write to");
  arguments->out.add_option(command, "the rows of planner.csv");
  command.callback([arguments, &exit_code] { exit_code = run_planner(*arguments); });
}

}  // namespace blindcorner
