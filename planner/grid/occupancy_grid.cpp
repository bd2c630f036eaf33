// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/grid/occupancy_grid.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

/// A cell is outside the search region if the prior's object reaches it with less than this
/// probability.
constexpr double kReached = 1e-9;
/// No cell is surer than this: odds stay finite, also against answers that are certain.
constexpr double kCertain = 1 - 1e-9;

double odds(double probability) { return probability / (1 - probability); }

[[noreturn]] void refuse(const std::string& field, double found, const std::string& accepted) {
  throw Error("OccupancyOptions." + field + " = " + std::to_string(found) +
              "; accepted: " + accepted);
}

void check_positive(const char* field, double value) {
  if (!(value > 0)) refuse(field, value, "a number > 0");
}

}  // namespace

void OccupancyOptions::validate() const {
  const auto inside = [](double p) { return p > 0 && p < 1; };
  const auto below_one = [](double p) { return p >= 0 && p < 1; };
  if (!inside(unseen_prior)) refuse("unseen_prior", unseen_prior, "more than 0, less than 1");
  if (!below_one(unmodelled_probability)) {
    refuse("unmodelled_probability", unmodelled_probability, "0 or more, less than 1");
  }
  if (!below_one(moving_prior)) refuse("moving_prior", moving_prior, "0 or more, less than 1");
  if (!inside(hit_if_free)) refuse("hit_if_free", hit_if_free, "more than 0, less than 1");
  if (!(hit_if_occupied > hit_if_free && hit_if_occupied < 1)) {
    refuse("hit_if_occupied", hit_if_occupied, "more than hit_if_free, less than 1");
  }
  check_positive("max_log_odds", max_log_odds);
  check_positive("moving_evidence_time", moving_evidence_time);
  check_positive("dwell_time", dwell_time);
}

OccupancyGrid::OccupancyGrid(const GridGeometry& geometry, const OccupancyOptions& options)
    : geometry_(geometry), options_(options) {
  geometry_.validate();
  options_.validate();
  static_evidence_.assign(geometry_.cells(), 0.0);
  moving_evidence_ = hidden_ = static_evidence_;
  seen_.assign(geometry_.cells(), 0);
  searchable_ = seen_;
}

OccupancyGrid::OccupancyGrid(const GridGeometry& geometry, const Scene& scene, const Motion& motion,
                             const OccupancyOptions& options)
    : OccupancyGrid(geometry, options) {
  spread_.emplace(scene, geometry);
  prediction_.emplace(scene, motion, options.dwell_time);
  PoseMixture anywhere = spread_->prior();
  anywhere.presence_probability = 1;
  const std::vector<double> reached = spread_->occupied(anywhere);
  std::ranges::transform(reached, searchable_.begin(),
                         [](double p) { return static_cast<std::uint8_t>(p > kReached); });
  spread_hidden();
}

void OccupancyGrid::update(double dt, const LineOfSightScan* scan, const HiddenAnswer* answer) {
  if (!(dt >= 0) || !std::isfinite(dt)) {
    throw Error("dt = " + std::to_string(dt) + "; accepted: seconds >= 0");
  }
  if (answer != nullptr) {
    if (!spread_) throw Error("an answer on hidden objects needs a grid that was made for a scene");
    // An invalid answer is refused before anything is changed. It must be a mixture, and remain one
    // when it is predicted.
    spread_->check(answer->mixture);
    spread_->check(prediction_->predicted(answer->mixture, answer->age, answer->velocities));
  }
  const double fading = std::exp(-dt / options_.moving_evidence_time);
  for (double& evidence : moving_evidence_) evidence *= fading;
  if (answer_) answer_->age += dt;
  if (scan != nullptr) see(*scan);
  if (answer != nullptr) answer_ = *answer;
  if (spread_) spread_hidden();
}

void OccupancyGrid::see(const LineOfSightScan& scan) {
  const double hit = std::log(options_.hit_if_occupied / options_.hit_if_free);
  const double pass = std::log((1 - options_.hit_if_occupied) / (1 - options_.hit_if_free));
  const double bound = options_.max_log_odds;
  // A moving object must be believed once it is seen, even if `moving_prior` hardly expects any.
  const double unexpected =
      options_.moving_prior > 0 ? std::max(0.0, -std::log(odds(options_.moving_prior))) : 0.0;
  const auto add = [&](std::vector<double>& evidence, std::size_t cell, double log_ratio) {
    const double highest = &evidence == &moving_evidence_ ? bound + unexpected : bound;
    evidence[cell] = std::clamp(evidence[cell] + log_ratio, -bound, highest);
    seen_[cell] = 1;
  };
  for (const std::size_t cell : scan.free) {
    add(static_evidence_, cell, pass);
    add(moving_evidence_, cell, pass);
  }
  for (const std::size_t cell : scan.surface_hits) add(static_evidence_, cell, hit);
  for (const std::size_t cell : scan.object_hits) add(moving_evidence_, cell, hit);
}

PoseMixture OccupancyGrid::hidden_mixture() const {
  if (!spread_) throw Error("hidden objects need a grid that was made for a scene");
  return answer_ ? prediction_->predicted(answer_->mixture, answer_->age, answer_->velocities)
                 : spread_->prior();
}

std::vector<double> OccupancyGrid::not_seen() const {
  std::vector<double> not_seen(geometry_.cells());
  std::ranges::transform(moving_evidence_, not_seen.begin(), [](double evidence) {
    return evidence < 0 ? std::exp(evidence) : 1.0;  // the likelihood of no return
  });
  return not_seen;
}

void OccupancyGrid::spread_hidden() { hidden_ = spread_->occupied(hidden_mixture(), not_seen()); }

void OccupancyGrid::add_static_evidence(const Cell& cell, double log_ratio) {
  if (!geometry_.contains(cell)) return;
  const std::size_t index = geometry_.index(cell);
  const double bound = options_.max_log_odds;
  static_evidence_[index] = std::clamp(static_evidence_[index] + log_ratio, -bound, bound);
  seen_[index] = 1;
}

double OccupancyGrid::odds_at(std::size_t index) const {
  const bool searched = answer_ && searchable_[index] != 0;
  const double prior = searched ? options_.unmodelled_probability : options_.unseen_prior;
  const double evidence = moving_evidence_[index];
  // h contains the passes already (spread_hidden). It does not contain the hits, which count at
  // once.
  const double other = odds(options_.moving_prior) * std::exp(std::min(evidence, 0.0));
  const double moving = std::min(kCertain, 1 - (1 - hidden_[index]) / (1 + other));
  const double of_static = odds(prior) * std::exp(static_evidence_[index]);
  const double of_moving = odds(moving) * std::exp(std::max(evidence, 0.0));
  return of_static + of_moving + of_static * of_moving;  // (1 + a) (1 + b) - 1
}

double OccupancyGrid::probability(const Cell& cell) const {
  if (!geometry_.contains(cell)) return options_.unseen_prior;
  return 1 - 1 / (1 + odds_at(geometry_.index(cell)));
}

std::vector<double> OccupancyGrid::probabilities() const {
  std::vector<double> cells(geometry_.cells());
  for (std::size_t i = 0; i < cells.size(); ++i) cells[i] = 1 - 1 / (1 + odds_at(i));
  return cells;
}

double OccupancyGrid::log_odds(const Cell& cell) const {
  return std::log(geometry_.contains(cell) ? odds_at(geometry_.index(cell))
                                           : odds(options_.unseen_prior));
}

bool OccupancyGrid::seen(const Cell& cell) const {
  return geometry_.contains(cell) && seen_[geometry_.index(cell)] != 0;
}

bool OccupancyGrid::known(const Cell& cell) const {
  return seen(cell) ||
         (answer_ && geometry_.contains(cell) && searchable_[geometry_.index(cell)] != 0);
}

}  // namespace blindcorner
