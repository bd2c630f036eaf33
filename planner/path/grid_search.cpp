// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/grid_search.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>
#include <string>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
/// Width of a bucket, cells times cost. Measured on city maps: narrower buckets do not save
/// expansions, and with wider ones cells are expanded before their cheapest way is known.
constexpr double kBucketWidth = 0.5;
/// Costlier cells share the last bucket, which is slower but just as exact.
constexpr std::size_t kMaxBuckets = 1U << 20U;

constexpr double kDiagonal = std::numbers::sqrt2;
constexpr std::array<double, kSteps> kStepLengths{1, kDiagonal, 1, kDiagonal,
                                                  1, kDiagonal, 1, kDiagonal};  // cells

/// Steps worth trying from a cell that `step` led to, if every cell costs the same. The cells
/// behind other steps can be reached at no higher cost without this cell. Of equal ways the one
/// with its diagonal steps first is kept (Harabor & Grastien 2011; Sturtevant & Rabin, "Canonical
/// Orderings on Grids", 2016), for the rule that diagonal steps do not cut corners. `steps` holds
/// all steps that the cell allows.
constexpr unsigned canonical_steps(unsigned step, unsigned steps) {
  const auto turned = [step](unsigned by) { return 1U << (step + by) % kSteps; };
  if (step % 2 == 1) return steps & (turned(0) | turned(1) | turned(7));
  unsigned kept = turned(0);
  // The cells beside the previous one matter: past an obstacle there, this cell is the only way.
  if ((steps & turned(3)) == 0) kept |= turned(1) | turned(2);
  if ((steps & turned(5)) == 0) kept |= turned(7) | turned(6);
  return steps & kept;
}

constexpr std::size_t kMasks = 1U << kSteps;
constexpr auto kCanonicalSteps = [] {
  std::array<std::array<std::uint8_t, kMasks>, kSteps> table{};
  for (unsigned step = 0; step < kSteps; ++step) {
    for (unsigned steps = 0; steps < kMasks; ++steps) {
      table[step][steps] = static_cast<std::uint8_t>(canonical_steps(step, steps));
    }
  }
  return table;
}();
/// The last step of a way that has none yet.
constexpr std::uint8_t kNoStep = kSteps;

/// Length of the shortest way between two cells without obstacles, cells.
double octile_distance(int columns, int rows) {
  const int longer = std::max(columns, rows), shorter = std::min(columns, rows);
  return longer + (kDiagonal - 1) * shorter;
}

PathStatus status_of_ends(const PlanningGrid& grid, const Cell& start, const Cell& goal) {
  if (!grid.geometry().contains(start)) return PathStatus::start_outside;
  if (!grid.traversable(start)) return PathStatus::start_blocked;
  if (!grid.geometry().contains(goal)) return PathStatus::goal_outside;
  if (!grid.traversable(goal)) return PathStatus::goal_blocked;
  return PathStatus::found;
}

}  // namespace

std::string_view path_status_word(PathStatus status) {
  switch (status) {
    case PathStatus::found:
      return "found";
    case PathStatus::no_path:
      return "no_path";
    case PathStatus::start_outside:
      return "start_outside";
    case PathStatus::goal_outside:
      return "goal_outside";
    case PathStatus::start_blocked:
      return "start_blocked";
    case PathStatus::goal_blocked:
      return "goal_blocked";
  }
  return "";
}

void GridSearchOptions::validate() const {
  if (heuristic_weight >= 1 && std::isfinite(heuristic_weight)) return;
  throw Error("GridSearchOptions.heuristic_weight = " + std::to_string(heuristic_weight) +
              "; accepted: a number >= 1");
}

GridSearch::GridSearch(const GridSearchOptions& options) : options_(options) { options.validate(); }

CellPath GridSearch::search(const PlanningGrid& grid, const Cell& start, const Cell& goal) {
  CellPath path;
  path.status = status_of_ends(grid, start, goal);
  if (path.status != PathStatus::found) return path;
  prepare(grid, goal);
  const std::size_t goal_index = grid.geometry().index(goal);
  reach(start, grid.geometry().index(start), 0, kNoStep);
  std::size_t expansions = 0;
  for (OpenCell open; pop(open, cost_[goal_index]);) {
    expand(grid, open);
    ++expansions;
  }
  if (cost_[goal_index] < kNever) {
    path = trace(grid, start, goal);
  } else {
    path.status = PathStatus::no_path;
  }
  path.expansions = expansions;
  return path;
}

/// Steps cost the same both ways. The search therefore begins at the goals, without an estimate.
std::vector<double> GridSearch::costs_to(const PlanningGrid& grid, std::span<const Cell> goals) {
  prepare(grid, {});
  estimate_scale_ = 0;
  for (const Cell& goal : goals) {
    if (grid.traversable(goal)) reach(goal, grid.geometry().index(goal), 0, kNoStep);
  }
  for (OpenCell open; pop(open, kNever);) expand(grid, open);
  std::vector<double> costs = cost_;
  for (double& cost : costs) cost *= grid.geometry().cell_size;
  return costs;
}

void GridSearch::prepare(const PlanningGrid& grid, const Cell& goal) {
  if (cost_.size() != grid.geometry().cells()) {
    cost_.assign(grid.geometry().cells(), kNever);
    step_.assign(grid.geometry().cells(), 0);
  } else {
    for (const std::uint32_t index : reached_) cost_[index] = kNever;
  }
  reached_.clear();
  for (std::vector<OpenCell>& bucket : buckets_) bucket.clear();
  lowest_ = 0;
  goal_ = goal;
  columns_ = static_cast<std::uint32_t>(grid.geometry().columns);
  estimate_scale_ = options_.heuristic_weight * grid.least_cost_factor();
}

double GridSearch::estimate(const Cell& cell) const {
  return estimate_scale_ *
         octile_distance(std::abs(goal_.column - cell.column), std::abs(goal_.row - cell.row));
}

void GridSearch::reach(const Cell& cell, std::size_t index, double cost, std::uint8_t step) {
  const auto small_index = static_cast<std::uint32_t>(index);
  if (cost_[index] == kNever) reached_.push_back(small_index);
  cost_[index] = cost;
  step_[index] = step;
  const auto bucket =
      std::min(kMaxBuckets - 1, static_cast<std::size_t>((cost + estimate(cell)) / kBucketWidth));
  if (bucket >= buckets_.size()) buckets_.resize(bucket + 1);
  buckets_[bucket].push_back({cost, small_index});
  lowest_ = std::min(lowest_, bucket);
}

/// Finds the next cell to expand. Returns false when no way is left that leads to a cost below
/// `bound`.
bool GridSearch::pop(OpenCell& open, double bound) {
  for (; lowest_ < buckets_.size(); ++lowest_) {
    const bool last = static_cast<double>(lowest_) * kBucketWidth >= bound;
    if (last) return false;
    std::vector<OpenCell>& bucket = buckets_[lowest_];
    while (!bucket.empty()) {
      open = bucket.back();
      bucket.pop_back();
      if (open.cost > cost_[open.index]) continue;  // a cheaper way was found meanwhile
      if (bound == kNever || open.cost + estimate(cell_at(open.index)) < bound) return true;
    }
  }
  return false;
}

void GridSearch::expand(const PlanningGrid& grid, const OpenCell& open) {
  const std::uint8_t last = step_[open.index];
  const bool uniform = grid.least_cost_factor() == grid.greatest_cost_factor();
  unsigned steps = grid.steps(open.index);
  if (uniform && last != kNoStep) steps = kCanonicalSteps[last][steps];
  const Cell cell = cell_at(open.index);
  const double half_factor = 0.5 * grid.cost_factor(open.index);
  for (; steps != 0; steps &= steps - 1) {
    const auto step = static_cast<std::size_t>(std::countr_zero(steps));
    const Cell next{cell.column + kStepColumns[step], cell.row + kStepRows[step]};
    const std::size_t index = grid.geometry().index(next);
    const double factor = uniform ? 2 * half_factor : half_factor + 0.5 * grid.cost_factor(index);
    const double cost = open.cost + kStepLengths[step] * factor;
    if (cost < cost_[index]) reach(next, index, cost, static_cast<std::uint8_t>(step));
  }
}

CellPath GridSearch::trace(const PlanningGrid& grid, const Cell& start, const Cell& goal) const {
  CellPath path;
  path.status = PathStatus::found;
  std::size_t straight = 0, diagonal = 0;
  // The cost is summed again: with a heuristic weight, a way may have become cheaper since it was
  // found.
  double cost = 0;
  for (Cell cell = goal; !(cell == start);) {
    path.cells.push_back(cell);
    const std::size_t index = grid.geometry().index(cell), step = step_[index];
    (step % 2 == 0 ? straight : diagonal)++;
    cell = {cell.column - kStepColumns[step], cell.row - kStepRows[step]};
    const double factors = grid.cost_factor(index) + grid.cost_factor(grid.geometry().index(cell));
    cost += kStepLengths[step] * 0.5 * factors;
  }
  path.cells.push_back(start);
  std::ranges::reverse(path.cells);
  path.length = grid.geometry().cell_size *
                (static_cast<double>(straight) + kDiagonal * static_cast<double>(diagonal));
  path.cost = grid.geometry().cell_size * cost;
  return path;
}

}  // namespace blindcorner
