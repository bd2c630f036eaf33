// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/grid/pose_spread.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "blindcorner/forward/error.h"
#include "planner/grid/object_marginal.h"
#include "planner/grid/object_spread.h"

namespace blindcorner {
namespace {

template <typename Function>
void for_each_cell(const Window& window, const GridGeometry& grid, Function function) {
  std::size_t from = 0;
  for (int row = 0; row < window.rows; ++row) {
    const std::size_t first = grid.index({window.first_column, window.first_row + row});
    for (std::size_t column = 0; column < static_cast<std::size_t>(window.columns); ++column) {
      function(first + column, window.values[from++]);
    }
  }
}

}  // namespace

struct PoseSpread::Impl {
  Impl(const Scene& scene, const GridGeometry& geometry)
      : grid(geometry), unknowns(scene.unknowns), presence_prior(scene.presence_prior) {
    grid.validate();
    for (int i = 0; i < object_count(scene); ++i) objects.emplace_back(scene, i);
  }

  void check(const PoseMixture& mixture) const;
  void check_mode(const PoseMode& mode, const std::string& name) const;
  double add_mode(const PoseMode& mode, std::span<const double> not_seen,
                  std::vector<double>& cells) const;

  GridGeometry grid;
  std::vector<Unknown> unknowns;
  std::vector<GroundObject> objects;
  double presence_prior = 0;
};

void PoseSpread::Impl::check_mode(const PoseMode& mode, const std::string& name) const {
  const auto n = static_cast<Eigen::Index>(unknowns.size());
  if (!(mode.weight >= 0 && mode.weight <= 1)) {
    throw Error(name, "weight is " + std::to_string(mode.weight) + "; accepted: 0 to 1");
  }
  if (mode.pose.size() != n || mode.covariance.rows() != n || mode.covariance.cols() != n) {
    throw Error(name, "has " + std::to_string(mode.pose.size()) + " values; accepted: " +
                          std::to_string(n) + ", with a covariance of as many rows and columns");
  }
  for (const GroundObject& object : objects) {
    if (is_absent(mode, object)) continue;
    for (const int i : object.unknowns) {
      const std::string what = component_name(unknowns[static_cast<std::size_t>(i)].component);
      if (!std::isfinite(mode.pose[i])) {
        throw Error(name, what + " is not finite; accepted: a number");
      }
      for (const int j : object.unknowns) {
        if (!std::isfinite(mode.covariance(i, j))) {
          throw Error(name, "covariance of " + what + " is not finite; accepted: a number");
        }
      }
      if (mode.covariance(i, i) < 0) {
        throw Error(name, "variance of " + what + " is " + std::to_string(mode.covariance(i, i)) +
                              "; accepted: 0 or more");
      }
    }
  }
}

void PoseSpread::Impl::check(const PoseMixture& mixture) const {
  const double presence = mixture.presence_probability;
  if (!(presence >= 0 && presence <= 1)) {
    throw Error("pose mixture",
                "presence_probability is " + std::to_string(presence) + "; accepted: 0 to 1");
  }
  double total = 0;
  for (std::size_t k = 0; k < mixture.modes.size(); ++k) {
    check_mode(mixture.modes[k], "pose mixture, mode " + std::to_string(k));
    total += mixture.modes[k].weight;
  }
  constexpr double kRounding = 1e-6;
  if (total > 1 + kRounding) {
    throw Error("pose mixture",
                "weights sum to " + std::to_string(total) + "; accepted: at most 1");
  }
}

/// Adds the probability that the mode holds, that nothing of it has been seen, and that an object
/// occupies the cell. Returns the probability of the first two.
double PoseSpread::Impl::add_mode(const PoseMode& mode, std::span<const double> not_seen,
                                  std::vector<double>& cells) const {
  std::vector<ObjectSpread> spreads;
  double weight = mode.weight;
  for (const GroundObject& object : objects) {
    if (is_absent(mode, object)) continue;
    spreads.push_back(spread(marginal_of(mode, unknowns, object), object, grid, not_seen));
    weight *= spreads.back().not_seen;
  }
  if (!(weight > 0)) return 0;
  if (spreads.size() == 1) {
    const double scale = weight / spreads.front().not_seen;
    for_each_cell(spreads.front().window, grid,
                  [&](std::size_t i, double p) { cells[i] += scale * p; });
    return weight;
  }
  std::vector<double> empty(cells.size(), 1.0);
  for (const ObjectSpread& one : spreads) {
    for_each_cell(one.window, grid, [&](std::size_t i, double p) {
      empty[i] *= 1 - std::min(1.0, p / one.not_seen);
    });
  }
  for (std::size_t i = 0; i < cells.size(); ++i) cells[i] += weight * (1 - empty[i]);
  return weight;
}

PoseSpread::PoseSpread(const Scene& scene, const GridGeometry& grid)
    : impl_(std::make_shared<const Impl>(scene, grid)) {}

std::vector<double> PoseSpread::occupied(const PoseMixture& mixture,
                                         std::span<const double> not_seen) const {
  check(mixture);
  check_not_seen(not_seen, impl_->grid);
  std::vector<double> cells(impl_->grid.cells(), 0.0);
  const double presence = mixture.presence_probability;
  if (presence == 0) return cells;
  double unseen = 0;
  for (const PoseMode& mode : with_prior(mixture, impl_->unknowns)) {
    if (mode.weight > 0) unseen += impl_->add_mode(mode, not_seen, cells);
  }
  // Bayes: present and unseen, against absent. The evidence is zero if presence was certain and
  // every pose has surely been seen to be empty.
  const double evidence = presence * unseen + (1 - presence);
  if (!(evidence > 0)) return std::vector<double>(cells.size(), 0.0);
  for (double& p : cells) p = std::min(1.0, p * presence / evidence);
  return cells;
}

void PoseSpread::check(const PoseMixture& mixture) const { impl_->check(mixture); }

PoseMixture PoseSpread::prior() const {
  PoseMixture mixture;
  mixture.presence_probability = impl_->presence_prior;
  return mixture;
}

}  // namespace blindcorner
