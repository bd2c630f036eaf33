// SPDX-License-Identifier: Apache-2.0
/// Occupancy of the ground: line of sight, hidden objects and the passing of time in one grid.
///
/// A cell is occupied by something static (s) or by something that moves (m). The two are taken as
/// independent:
///
///     p = 1 - (1 - p_s) (1 - p_m)
///     logit p_s = logit s0 + L_s
///     logit p_m = logit (1 - (1 - h) (1 - o)) + max(L_m, 0)
///     logit o   = logit m0 + min(L_m, 0)
///
/// L_s and L_m are the log likelihood ratios of everything that line of sight has shown of the
/// cell; each scan counts once. A ray that passed through lowers both, a ray that ended on the
/// known scene raises L_s, and a ray that ended on anything else raises L_m. L_m fades with time,
/// because moving objects may have come or gone; L_s does not fade. Both are bounded, so that later
/// evidence can still change every cell.
///
/// h is the probability that a hidden object occupies the cell, o the probability that any other
/// moving object does (m0: `moving_prior`). h comes from the latest answer of the solver or the
/// tracker, spread over footprints (pose_spread.h). A posterior already contains everything that
/// earlier frames have shown. Therefore a new posterior replaces the old one and is never
/// multiplied with it. Poses that line of sight has just shown to be empty are removed from h by
/// Bayes' rule, with the likelihood exp(min(L_m, 0)) of each cell; the rule also updates the
/// probability of presence. So h already contains the passes, and they lower o alone. Hits may be
/// of the hidden object or of another object, so they raise the cell whatever was expected there.
/// Without a new answer the last answer is predicted forward (hidden_motion.h).
///
/// s0 is the prior. It is `unseen_prior` where nothing is known, and `unmodelled_probability` in
/// the region that an answer covers: the answer says that the scene's model explains the light, so
/// that only the hidden object is there.
///
/// Rays that pass through exclude "s or m". The two factors express this up to a term of the order
/// of p_s p_m, which is negligible wherever one of them is small.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "blindcorner/forward/scene/motion.h"
#include "blindcorner/planner/grid/hidden_motion.h"
#include "blindcorner/planner/grid/line_of_sight.h"
#include "blindcorner/planner/grid/pose_spread.h"

namespace blindcorner {

struct OccupancyOptions {
  /// Probability that something static occupies a cell about which nothing is known.
  double unseen_prior = 0.5;
  /// The same in the region that an answer covers: things that the scene's model leaves out. It is
  /// set by means of the trials' reliability diagram.
  double unmodelled_probability = 0.01;
  /// Probability that a moving object other than the scene's hidden objects occupies a cell; 0:
  /// nothing else moves, whatever is seen.
  double moving_prior = 0.003;
  /// Probability that a ray ends in a cell on its way if the cell is occupied, and if it is free.
  double hit_if_occupied = 0.9, hit_if_free = 0.001;
  /// Bound of the log odds that line of sight can reach from even odds; 6.9 is a thousand to one.
  /// For moving objects the upper bound counts from `moving_prior` instead of even odds.
  double max_log_odds = 6.9;
  /// Time constant with which L_m fades, s: a pedestrian crosses a car's width within it.
  double moving_evidence_time = 1.0;
  /// Mean time that a hidden object stays, s (TrackerOptions::dwell_time). Without new answers the
  /// hidden layer returns to the scene's prior with this time constant.
  double dwell_time = 60.0;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// The perception's answer about hidden objects.
struct HiddenAnswer {
  PoseMixture mixture;
  double age = 0;  ///< s since the capture that the answer is about
  /// [modes] as far as the tracker knows them; empty: any direction, Motion::initial_speed.
  std::vector<PoseVelocity> velocities;
};

class OccupancyGrid {
 public:
  /// A grid without hidden objects. Throws Error when geometry or options are not valid.
  explicit OccupancyGrid(const GridGeometry& geometry, const OccupancyOptions& options = {});
  /// A grid for the hidden objects of a scene; the scene's prior holds until the first answer.
  OccupancyGrid(const GridGeometry& geometry, const Scene& scene, const Motion& motion,
                const OccupancyOptions& options = {});

  const GridGeometry& geometry() const { return geometry_; }
  const OccupancyOptions& options() const { return options_; }

  /// One frame: `dt` seconds pass, then the scan and the answer arrive (null: none). Throws Error
  /// for a negative or infinite time, for an answer that is not valid, and for an answer to a grid
  /// without hidden objects.
  void update(double dt, const LineOfSightScan* scan, const HiddenAnswer* answer);

  /// Adds static evidence from another source, such as a loaded map: a log likelihood ratio.
  void add_static_evidence(const Cell& cell, double log_ratio);

  /// Probability that the cell is occupied; `unseen_prior` for cells outside the grid.
  double probability(const Cell& cell) const;
  /// [cells] the same for all cells.
  std::vector<double> probabilities() const;
  /// Whether more than the prior is known of the cell: line of sight has seen it, a loaded map
  /// contains it, or it lies in the region that an answer covers. A cell that was measured at even
  /// odds is known.
  bool known(const Cell& cell) const;
  /// Whether line of sight or a loaded map has shown the cell.
  bool seen(const Cell& cell) const;
  /// Log odds of the cell.
  double log_odds(const Cell& cell) const;
  /// [cells] h, the probability that a hidden object occupies the cell, after passes of line of
  /// sight.
  const std::vector<double>& hidden() const { return hidden_; }
  /// The source of h, before passes of line of sight: the latest answer predicted to now, or the
  /// prior. Throws Error for a grid without hidden objects.
  PoseMixture hidden_mixture() const;
  /// [cells] likelihood of the passes of line of sight, if the cell were occupied.
  std::vector<double> not_seen() const;

 private:
  double odds_at(std::size_t index) const;
  void see(const LineOfSightScan& scan);
  void spread_hidden();

  GridGeometry geometry_;
  OccupancyOptions options_;
  Motion motion_;
  std::optional<PoseSpread> spread_;
  std::optional<HiddenMotion> prediction_;
  std::optional<HiddenAnswer> answer_;   ///< the latest answer; its age grows
  std::vector<double> static_evidence_;  ///< L_s
  std::vector<double> moving_evidence_;  ///< L_m
  std::vector<double> hidden_;           ///< h
  std::vector<std::uint8_t> seen_, searchable_;
};

}  // namespace blindcorner
