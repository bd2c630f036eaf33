// SPDX-License-Identifier: Apache-2.0
/// What stands where: line of sight, hidden objects and the passing of time in one grid.
///
/// A cell is occupied by something that stays (s), or by something that moves (m), which are taken
/// as independent:
///
///     p = 1 - (1 - p_s) (1 - p_m)
///     logit p_s = logit s0 + L_s
///     logit p_m = logit (1 - (1 - h) (1 - o)) + max(L_m, 0)
///     logit o   = logit m0 + min(L_m, 0)
///
/// L_s and L_m are the log likelihood ratios of all that line of sight has shown of the cell, each
/// scan counted once: a ray that passed through lowers both, one that ended on the known scene
/// raises L_s, one that ended on anything else raises L_m. L_m fades with time, because what moves
/// may have come or gone; L_s does not. Both are bounded, so that no cell is beyond recall.
///
/// h is the probability that a hidden object occupies the cell, o that anything else which moves
/// does (m0: `moving_prior`). h is the latest answer of the solver or the tracker, spread over
/// footprints (pose_spread.h). A posterior holds all that earlier frames have shown, so it replaces
/// its predecessor and is never multiplied with it. Poses that line of sight has just shown to be
/// empty are taken out of it, by Bayes' rule with the likelihood exp(min(L_m, 0)) of each cell, the
/// probability of presence included. So h holds the passes already and they lower o alone; hits,
/// which may be of the hidden object or of another, raise the cell whatever was expected there.
/// Without a new answer the last one is moved on (hidden_motion.h).
///
/// s0 is the prior: `unseen_prior` where nothing is known; `unmodelled_probability` in the region
/// that an answer speaks about, because it says that the scene's model explains the light, so that
/// nothing but the hidden object is there.
///
/// Rays that pass through exclude "s or m", which the two factors express up to a term of the order
/// of p_s p_m: negligible wherever one of them is small.
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
  /// Probability that something which stays occupies a cell of which nothing is known.
  double unseen_prior = 0.5;
  /// The same in the region that an answer speaks about: what the scene's model leaves out. The
  /// reliability diagram of the trials is what it is set by.
  double unmodelled_probability = 0.01;
  /// Probability that something moving which is no hidden object of the scene occupies a cell; 0:
  /// nothing else moves, whatever is seen.
  double moving_prior = 0.003;
  /// Probability that a ray through an occupied cell ends there, and that it ends in a free one.
  double hit_if_occupied = 0.9, hit_if_free = 0.001;
  /// Bound of what line of sight can say, as log odds from even ones (of what moves: upwards from
  /// `moving_prior`); 6.9 is a thousand to one.
  double max_log_odds = 6.9;
  /// Time constant with which L_m fades, s: someone on foot crosses a car's width within it.
  double moving_evidence_time = 1.0;
  /// Mean time that a hidden object stays, s (TrackerOptions::dwell_time). Without new answers the
  /// hidden layer returns to the scene's prior with it.
  double dwell_time = 60.0;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// What the perception says of hidden objects.
struct HiddenAnswer {
  PoseMixture mixture;
  double age = 0;  ///< s since the capture that it is about
  /// [modes] as far as known (tracker); empty: any direction, Motion::initial_speed.
  std::vector<PoseVelocity> velocities;
};

class OccupancyGrid {
 public:
  /// A grid without hidden objects. Throws Error when geometry or options are not valid.
  explicit OccupancyGrid(const GridGeometry& geometry, const OccupancyOptions& options = {});
  /// A grid for the hidden objects of a scene, whose prior holds until the first answer.
  OccupancyGrid(const GridGeometry& geometry, const Scene& scene, const Motion& motion,
                const OccupancyOptions& options = {});

  const GridGeometry& geometry() const { return geometry_; }
  const OccupancyOptions& options() const { return options_; }

  /// One frame: `dt` seconds pass, then come what was seen and what was answered (null: nothing).
  /// Throws Error for a negative or infinite time, and for an answer that is none.
  void update(double dt, const LineOfSightScan* scan, const HiddenAnswer* answer);

  /// Evidence on what stays from elsewhere, a map that was loaded: log likelihood ratio to add.
  void add_static_evidence(const Cell& cell, double log_ratio);

  /// Probability that the cell is occupied; of cells beside the grid `unseen_prior`.
  double probability(const Cell& cell) const;
  /// [cells] the same of all.
  std::vector<double> probabilities() const;
  /// Whether anything but the prior speaks of the cell: it was seen, is in a loaded map, or lies in
  /// the region of an answer. A cell that was measured to be as likely as not is known.
  bool known(const Cell& cell) const;
  /// Whether line of sight or a loaded map has shown the cell.
  bool seen(const Cell& cell) const;
  /// Log odds of the cell.
  double log_odds(const Cell& cell) const;
  /// [cells] probability that a hidden object occupies the cell, after passes of line of sight: h.
  const std::vector<double>& hidden() const { return hidden_; }
  /// What h is made from: the latest answer moved on to now, or the prior, before passes of line of
  /// sight; and the likelihood of those passes [cells], were the cell occupied. The first throws
  /// Error for a grid without hidden objects.
  PoseMixture hidden_mixture() const;
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
  std::optional<HiddenAnswer> answer_;   ///< the latest, its age growing
  std::vector<double> static_evidence_;  ///< L_s
  std::vector<double> moving_evidence_;  ///< L_m
  std::vector<double> hidden_;           ///< h
  std::vector<std::uint8_t> seen_, searchable_;
};

}  // namespace blindcorner
