// SPDX-License-Identifier: Apache-2.0
/// A moving object in a sequence of frames: prediction, rival modes, presence.
///
/// Multiple-hypothesis filter (Reid 1979; Bar-Shalom, Li & Kirubarajan 2001, chapters 5, 6 and 11).
/// A hypothesis is a normal distribution over pose, brightness and velocity. Each frame splits a
/// hypothesis: the frame shows the object where it was predicted; the frame shows something else or
/// nothing, so the hypothesis is only predicted; or the object is elsewhere, and a new hypothesis
/// starts there. Evidences weigh the hypotheses. Similar hypotheses are merged, and negligible ones
/// are dropped.
#pragma once

#include <Eigen/Core>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "blindcorner/forward/scene/motion.h"
#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/inverse/tracking/frame_likelihood.h"

namespace blindcorner {

/// How hypotheses are kept. Motion holds what is known about the object's motion. Probabilities and
/// times are priors by judgement; only their order of magnitude matters.
struct TrackerOptions {
  /// Probability that a frame shows nothing, or something else, although the object is there.
  double missed_probability = 0.01;
  /// Probability per frame that the object is where the track did not expect it.
  double lost_probability = 1e-4;
  /// An innovation as improbable as this triggers a search of the whole region. One frame in a
  /// thousand triggers a search in vain.
  double gate_probability = 1e-3;
  /// Time after which the whole region is searched in any case, s. A young track's region is
  /// searched each time the track's age has doubled.
  double search_interval = 2.0;
  /// While nothing is tracked, the region is searched where FrameLikelihood::look gives an object
  /// at least this probability; 0: in every frame. A track begins at one half. The margin allows
  /// for a factor of twenty in odds by which the look may be off.
  double worth_a_search = 0.05;
  /// The look must also tell places apart, by at least this many nats. With less, presence stays as
  /// uncertain as it was, and there is nothing to follow. By judgement: frames of dim walks have
  /// one nat, frames that no light of the region can reach have none.
  double least_information = 0.1;
  /// Hypotheses closer than this (squared Mahalanobis distance under the mean of their covariances)
  /// are merged: two equal Gaussians have one summit until they are two standard deviations apart.
  double merge_distance2 = 1.0;
  /// Hypotheses with less weight relative to the heaviest are dropped: a hypothesis that restarts a
  /// lost track begins with as little. At most `max_modes` are kept, because each costs a descent
  /// per frame.
  double negligible_weight = 1e-4;
  int max_modes = 8;
  /// Frames of a young track that are kept. While the track has no more frames, each search of the
  /// region judges each place by all of them, the latest first. By judgement: a second or two.
  int young_frames = 16;
  /// Mean time that an object stays, s. At a prior probability of presence of one half, also the
  /// mean time that it stays away.
  double dwell_time = 60.0;
  /// Time constant with which the inflation of the measurement's covariance follows the normalised
  /// innovations, s: many frames, and less than an object stays. `max_inflation` bounds the
  /// inflation at standard deviations three times as large; beyond that, the model is wrong.
  double inflation_time = 5.0;
  double max_inflation = 10.0;
  /// Frames that are kept for smoothing in addition to the last one, which bounds the memory. 0:
  /// all.
  int lag = 0;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Layout of a track's state: unknowns, log brightness, velocities.
struct TrackLayout {
  TrackLayout(const Scene& scene, const Motion& motion);

  Eigen::Index poses = 0;            ///< unknowns of the scene
  Eigen::Index measured = 0;         ///< the unknowns, and the brightness where it is shared
  Eigen::Index size = 0;             ///< `measured` and the velocities
  std::vector<Eigen::Index> moving;  ///< the unknown that velocity `measured + i` belongs to
  Eigen::VectorXd drift;             ///< [measured] random walk, unit/sqrt(s)
  Eigen::VectorXd period;            ///< [measured] period of circular unknowns, else 0

  /// b - a, the short way around on circles.
  Eigen::VectorXd difference(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const;
};

/// Transition over `dt`: x -> F x, covariance P -> F P F' + Q. Positions move with their velocity.
/// White acceleration of spectral density q changes the velocity: Q = q [dt^3/3 dt^2/2; dt^2/2 dt].
/// Everything else walks at random.
void predict(const TrackLayout& layout, const Motion& motion, double dt, Gaussian& state);

/// Carries the posterior of the measured part over to the whole state. This is exact where frame
/// and prediction are normal: it is then the Kalman update.
void condition(const TrackLayout& layout, const Gaussian& measured, Gaussian& state);

/// Squared innovation in units of its covariance, and the number of directions that the frame
/// measured.
struct Innovation {
  double squared = 0;
  double freedom = 0;
};
Innovation innovation(const TrackLayout& layout, const Gaussian& predicted,
                      const Gaussian& measured);

/// One explanation of the frames so far.
struct TrackMode {
  double weight = 0;
  Gaussian state;
  double log_likelihood = 0;
  int age = 0;      ///< frames since the mode began
  int coasted = 0;  ///< frames since a frame last showed the object
  int node = -1;    ///< index in the history
};

/// What is known after a frame, from this frame and the earlier ones.
struct TrackPoint {
  std::vector<TrackMode> modes;  ///< heaviest first; empty: nothing is tracked
  double presence_probability = 0;
  double inflation = 1;   ///< factor on the measurement's covariance, from the innovations so far
  Innovation innovation;  ///< of the heaviest mode's prediction
  bool searched = false;  ///< the whole region was searched
};

/// Filters frame by frame, and smooths the filtered states. Not thread safe.
class Tracker {
 public:
  Tracker(const Scene& scene, const Motion& motion, TrackerOptions options = {});

  /// Takes in the next frame, `dt` seconds after the previous one (`dt` is ignored for the first).
  /// Frames of a young track are kept.
  TrackPoint advance(double dt, std::shared_ptr<const FrameLikelihood> frame);

  /// The state at each kept frame, [first_kept_frame() to the last], given all frames before and
  /// after it: Rauch-Tung-Striebel smoothing along the hypotheses that survived. Empty where
  /// nothing was tracked.
  std::vector<std::optional<Gaussian>> smoothed() const;
  int first_kept_frame() const { return frames_ - static_cast<int>(heaviest_.size()); }

  /// Modes after the latest frame, heaviest first; empty: nothing is tracked.
  const std::vector<TrackMode>& modes() const { return modes_; }
  const TrackLayout& layout() const { return layout_; }
  const Motion& motion() const { return motion_; }

 private:
  struct Node {
    int parent = -1;
    int frame = 0;
    double dt = 0;
    Gaussian predicted, filtered;
  };
  struct Hypothesis;
  /// A frame of a young track.
  struct YoungFrame {
    std::shared_ptr<const FrameLikelihood> likelihood;
    double dt = 0;  ///< s, since the previous frame
    double inflation = 1;
  };

  /// FrameLikelihood::update or rough_update.
  using UpdateFunction = FrameLikelihood::Update (FrameLikelihood::*)(const Gaussian&,
                                                                      const Eigen::VectorXd&,
                                                                      double) const;

  void leave_out_negligible(std::vector<Hypothesis>& hypotheses) const;
  void predict_all(double dt);
  bool search_is_due() const;
  double log_odds(double log_present, double log_empty) const;
  std::vector<Hypothesis> explain(const FrameLikelihood& frame, TrackPoint& point);
  void search(const FrameLikelihood& frame, std::span<const Eigen::VectorXd> starts, double share,
              std::vector<Hypothesis>& hypotheses) const;
  Gaussian at_first(const Gaussian& measured) const;
  std::vector<Gaussian> before_young() const;
  Hypothesis judged_by_latest(const std::vector<Gaussian>& before, const Eigen::VectorXd& place,
                              UpdateFunction by) const;
  Hypothesis judged_by_all(const std::vector<Gaussian>& before, const Hypothesis& latest,
                           UpdateFunction by) const;
  void search_young(std::vector<Eigen::VectorXd> places, std::vector<Hypothesis>& shown) const;
  void keep(std::vector<Hypothesis> hypotheses);
  void adapt(const Innovation& innovation, double dt);
  bool too_close(const Hypothesis& a, const Hypothesis& b) const;
  std::vector<Hypothesis>::iterator like(std::vector<Hypothesis>& among,
                                         const Hypothesis& hypothesis) const;

  TrackLayout layout_;
  Motion motion_;
  TrackerOptions options_;
  double presence_prior_;
  Gaussian unknown_;  ///< the prior of the measured part, before any frame
  std::vector<TrackMode> modes_;
  const Node& node_of(int node) const {
    return history_[static_cast<std::size_t>(node - forgotten_nodes_)];
  }
  Node& node_of(int node) { return history_[static_cast<std::size_t>(node - forgotten_nodes_)]; }
  void forget();

  std::deque<Node> history_;
  int forgotten_nodes_ = 0;
  std::deque<int> heaviest_;       ///< node of the heaviest mode after each kept frame; -1: none
  std::vector<YoungFrame> young_;  ///< frames since the track began, while they are few
  double log_evidence_young_ = 0;  ///< of the young frames except the latest
  double presence_ = 0;
  double inflation_ = 1;
  double since_search_ = 0;
  double heaviest_age_ = 0;  ///< s since the heaviest mode began
  int frames_ = 0;
};

/// Tracks one frame of a sequence and returns it as a result. The modes are those of the track
/// after this frame. Their means and covariances are the filter's; the covariances include the
/// motion's position error. The result's `track` lacks what later frames add. Unless `described`,
/// it has no histograms and no goodness of fit, which take a tenth of the time.
FitResult track_frame(const Fitter& fitter, Tracker& tracker, const Capture& capture, double dt,
                      bool described = true);

/// Adds the tracker's smoothed states to the results of all its frames, given in order.
void add_smoothed(const Scene& scene, const Tracker& tracker, std::span<FitResult> results);

}  // namespace blindcorner
