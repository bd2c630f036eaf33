// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/tracking/tracker.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "blindcorner/forward/error.h"
#include "forward/support/parallel.h"
#include "inverse/posterior/posterior.h"
#include "inverse/posterior/prior_moments.h"
#include "inverse/search/compiled_scene.h"

namespace blindcorner {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A direction counts as measured when the frame took away this share of its variance, which is a
/// per cent of its standard deviation. By judgement.
constexpr double kMeasured = 0.02;
/// Most that one innovation counts when the inflation is adapted, as it may be an outlier: three
/// standard deviations squared.
constexpr double kMaxSurprise = 9;
/// Below this probability of presence a track ends, because absence is then more likely.
constexpr double kGone = 0.5;
/// Largest share of the time constant that one frame may count for, by judgement: after a long gap,
/// a single frame must not set the inflation.
constexpr double kMaxElapsed = 0.1;

double log_sum(double a, double b) {
  const double top = std::max(a, b);
  if (!std::isfinite(top)) return top;
  return top + std::log(std::exp(a - top) + std::exp(b - top));
}

/// Probability that chi-square with `freedom` degrees exceeds `value` (Wilson & Hilferty 1931).
double chi_square_tail(double value, double freedom) {
  if (freedom <= 0) return 1;
  const double spread = 2 / (9 * freedom);
  const double z = (std::cbrt(std::max(value, 0.0) / freedom) - (1 - spread)) / std::sqrt(spread);
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

void symmetrise(MatrixXd& m) { m = 0.5 * (m + m.transpose().eval()); }

MatrixXd transition(const TrackLayout& layout, double dt) {
  MatrixXd F = MatrixXd::Identity(layout.size, layout.size);
  for (std::size_t i = 0; i < layout.moving.size(); ++i) {
    F(layout.moving[i], layout.measured + static_cast<Index>(i)) = dt;
  }
  return F;
}

Gaussian measured_part(const TrackLayout& layout, const Gaussian& state) {
  return {state.mean.head(layout.measured),
          state.covariance.topLeftCorner(layout.measured, layout.measured)};
}

bool is_position(Component component) {
  return component == Component::x || component == Component::y || component == Component::z;
}

/// The measured part before anything is known: normal with the prior's moments.
Gaussian unknown_state(const Scene& scene, const TrackLayout& layout) {
  Gaussian prior{VectorXd::Zero(layout.measured), MatrixXd::Zero(layout.measured, layout.measured)};
  for (Index i = 0; i < layout.poses; ++i) {
    const PriorMoments moments = prior_moments(scene, static_cast<std::size_t>(i));
    prior.mean[i] = moments.mean;
    prior.covariance(i, i) = moments.variance;
  }
  if (layout.measured > layout.poses) {
    const AmplitudePrior& amplitude = scene.linear.amplitude_prior;
    prior.mean[layout.poses] = std::log(amplitude.median);
    prior.covariance(layout.poses, layout.poses) = amplitude.sigma_log * amplitude.sigma_log;
  }
  return prior;
}

/// The smoothed state, which adds the later frames to a filtered state (Rauch, Tung & Striebel
/// 1965). `step` takes `filtered` to `predicted`; with the later frames, `predicted` becomes
/// `after`.
Gaussian smoothed_by(const TrackLayout& layout, const MatrixXd& step, const Gaussian& filtered,
                     const Gaussian& predicted, const Gaussian& after) {
  const MatrixXd gain = predicted.covariance.ldlt().solve(step * filtered.covariance).transpose();
  Gaussian smooth;
  smooth.mean = filtered.mean + gain * layout.difference(predicted.mean, after.mean);
  smooth.covariance =
      filtered.covariance + gain * (after.covariance - predicted.covariance) * gain.transpose();
  symmetrise(smooth.covariance);
  return smooth;
}

double drift_of(const Motion& motion, Component component) {
  switch (component) {
    case Component::yaw:
      return motion.yaw_drift;
    case Component::size:
      return motion.size_drift;
    case Component::z:
      return motion.height_drift;
    default:
      return 0;
  }
}

}  // namespace

void TrackerOptions::validate() const {
  const auto require = [](bool condition, const char* field, const char* accepted) {
    if (!condition)
      throw Error(std::string("TrackerOptions.") + field, std::string("accepted: ") + accepted);
  };
  const auto probability = [](double p) { return p > 0 && p < 1; };
  require(probability(missed_probability), "missed_probability", "between 0 and 1");
  require(probability(lost_probability), "lost_probability", "between 0 and 1");
  require(probability(gate_probability), "gate_probability", "between 0 and 1");
  require(search_interval > 0, "search_interval", "above 0");
  require(worth_a_search >= 0 && worth_a_search < 1, "worth_a_search", "0 to below 1");
  require(least_information >= 0, "least_information", "at least 0");
  require(merge_distance2 >= 0, "merge_distance2", "at least 0");
  require(negligible_weight >= 0 && negligible_weight < 1, "negligible_weight", "0 to below 1");
  require(max_modes >= 1, "max_modes", "at least 1");
  require(young_frames >= 0, "young_frames", "at least 0");
  require(dwell_time > 0, "dwell_time", "above 0");
  require(inflation_time > 0, "inflation_time", "above 0");
  require(lag >= 0, "lag", "at least 0");
  require(max_inflation >= 1, "max_inflation", "at least 1");
}

TrackLayout::TrackLayout(const Scene& scene, const Motion& motion) {
  poses = static_cast<Index>(scene.unknowns.size());
  measured = poses + (scene.linear.amplitude == LinearMode::shared ? 1 : 0);
  drift = VectorXd::Zero(measured);
  period = VectorXd::Zero(measured);
  if (measured > poses) drift[poses] = motion.brightness_drift;
  for (Index i = 0; i < poses; ++i) {
    const Unknown& unknown = scene.unknowns[static_cast<std::size_t>(i)];
    drift[i] = drift_of(motion, unknown.component);
    period[i] = period_of(scene, static_cast<std::size_t>(i));
    if (unknown.component == Component::x || unknown.component == Component::y) {
      moving.push_back(i);
    }
  }
  size = measured + static_cast<Index>(moving.size());
}

VectorXd TrackLayout::difference(const VectorXd& a, const VectorXd& b) const {
  VectorXd d = b - a;
  for (Index i = 0; i < std::min(d.size(), measured); ++i) {
    if (period[i] > 0) d[i] -= period[i] * std::round(d[i] / period[i]);
  }
  return d;
}

void predict(const TrackLayout& layout, const Motion& motion, double dt, Gaussian& state) {
  const MatrixXd F = transition(layout, dt);
  state.mean = F * state.mean;
  state.covariance = F * state.covariance * F.transpose();
  const double q = motion.acceleration_density;
  for (std::size_t i = 0; i < layout.moving.size(); ++i) {
    const Index p = layout.moving[i];
    const Index v = layout.measured + static_cast<Index>(i);
    state.covariance(p, p) += q * dt * dt * dt / 3;
    state.covariance(p, v) += q * dt * dt / 2;
    state.covariance(v, p) += q * dt * dt / 2;
    state.covariance(v, v) += q * dt;
  }
  for (Index i = 0; i < layout.measured; ++i) {
    state.covariance(i, i) += layout.drift[i] * layout.drift[i] * dt;
  }
  symmetrise(state.covariance);
}

void condition(const TrackLayout& layout, const Gaussian& measured, Gaussian& state) {
  const Index m = layout.measured;
  const Gaussian before = measured_part(layout, state);
  // Gain of the whole state on its measured part; the identity for that part itself.
  const MatrixXd gain = before.covariance.ldlt().solve(state.covariance.topRows(m)).transpose();
  state.mean += gain * layout.difference(before.mean, measured.mean);
  state.covariance -= gain * (before.covariance - measured.covariance) * gain.transpose();
  state.mean.head(m) = measured.mean;
  symmetrise(state.covariance);
}

Innovation innovation(const TrackLayout& layout, const Gaussian& predicted,
                      const Gaussian& measured) {
  // With prior P = L L' and posterior C, the update moves the mean by a vector with covariance
  // P - C.
  const Eigen::LLT<MatrixXd> root(predicted.covariance);
  const auto L = root.matrixL();
  MatrixXd left = L.solve(measured.covariance);
  MatrixXd known = MatrixXd::Identity(left.rows(), left.cols()) - L.solve(left.transpose().eval());
  symmetrise(known);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(known);
  const VectorXd moved =
      eigen.eigenvectors().transpose() * L.solve(layout.difference(predicted.mean, measured.mean));
  Innovation result;
  for (Index i = 0; i < moved.size(); ++i) {
    if (eigen.eigenvalues()[i] < kMeasured) continue;
    result.squared += moved[i] * moved[i] / eigen.eigenvalues()[i];
    result.freedom += 1;
  }
  return result;
}

/// A candidate for a mode after the next frame. Tracker::keep() decides which ones are kept.
struct Tracker::Hypothesis {
  double log_weight = 0;
  Gaussian predicted, filtered;
  double log_likelihood = 0;
  int age = 0;
  int coasted = 0;
  int parent = -1;  ///< node
};

Tracker::Tracker(const Scene& scene, const Motion& motion, TrackerOptions options)
    : layout_(scene, motion),
      motion_(motion),
      options_(options),
      presence_prior_(scene.presence_prior),
      unknown_(unknown_state(scene, layout_)),
      presence_(scene.presence_prior) {
  options_.validate();
}

TrackPoint Tracker::advance(double dt, std::shared_ptr<const FrameLikelihood> frame) {
  if (frames_ == 0) dt = 0;
  predict_all(dt);
  TrackPoint point;
  point.inflation = inflation_;
  const bool began = modes_.empty();
  if (began) {
    young_.clear();
    log_evidence_young_ = 0;
  }
  if (began || !young_.empty()) young_.push_back({frame, dt, inflation_});
  keep(explain(*frame, point));
  if (presence_ < kGone) modes_.clear();
  if (static_cast<int>(young_.size()) >= options_.young_frames) young_.clear();
  for (TrackMode& mode : modes_) {
    node_of(mode.node).dt = dt;
  }
  if (modes_.empty() || modes_.front().age == 0) heaviest_age_ = 0;
  heaviest_.push_back(modes_.empty() ? -1 : modes_.front().node);
  if (!modes_.empty() && modes_.front().coasted == 0) adapt(point.innovation, dt);
  ++frames_;
  forget();
  point.modes = modes_;
  point.presence_probability = presence_;
  return point;
}

void Tracker::predict_all(double dt) {
  for (TrackMode& mode : modes_) predict(layout_, motion_, dt, mode.state);
  since_search_ += dt;
  heaviest_age_ += dt;
  // An object comes and goes at random. In the long run, the rates keep the prior probability.
  const double leave = 1 - std::exp(-dt / options_.dwell_time);
  const double come = std::min(1.0, leave * presence_prior_ / (1 - presence_prior_));
  presence_ = presence_ * (1 - leave) + (1 - presence_) * come;
}

/// A young track may have begun at the wrong one of several optima, and its own predictions never
/// leave that one. The region is therefore searched again each time the track's age has doubled.
bool Tracker::search_is_due() const {
  return since_search_ >= std::min(options_.search_interval, heaviest_age_ / 2);
}

/// Log odds of presence after a frame, from the frame's log evidence with an object and without
/// one. A prior of one leaves no doubt; the logarithm of zero is then intended.
double Tracker::log_odds(double log_present, double log_empty) const {
  return std::log(presence_) + log_present - std::log(1 - presence_) - log_empty;
}

/// All explanations of a frame with their weights; updates the probability of presence.
std::vector<Tracker::Hypothesis> Tracker::explain(const FrameLikelihood& frame, TrackPoint& point) {
  const double log_empty = frame.log_evidence_empty(inflation_);
  if (modes_.empty() && options_.worth_a_search > 0) {
    const FrameLikelihood::Look look = frame.look(inflation_);
    const double presence = 1 / (1 + std::exp(-log_odds(look.log_evidence, log_empty)));
    if (presence < options_.worth_a_search || look.information < options_.least_information) {
      presence_ = presence;
      return {};
    }
  }
  std::vector<Hypothesis> shown;
  bool surprised = false;
  std::vector<FrameLikelihood::Update> updates(modes_.size());
  parallel_for(std::size_t{0}, modes_.size(), [&](std::size_t i) {
    const Gaussian prior = measured_part(layout_, modes_[i].state);
    updates[i] = frame.update(prior, prior.mean, inflation_);
  });
  for (std::size_t i = 0; i < modes_.size(); ++i) {
    const TrackMode& mode = modes_[i];
    const Gaussian prior = measured_part(layout_, mode.state);
    const FrameLikelihood::Update& update = updates[i];
    Hypothesis next;
    next.log_weight = std::log(mode.weight) + update.log_evidence;
    next.predicted = next.filtered = mode.state;
    condition(layout_, update.posterior, next.filtered);
    next.log_likelihood = update.log_likelihood;
    next.age = mode.age + 1;
    next.parent = mode.node;
    if (shown.empty()) {
      point.innovation = innovation(layout_, prior, update.posterior);
      const double tail = chi_square_tail(point.innovation.squared, point.innovation.freedom);
      surprised = surprised || tail < options_.gate_probability || update.log_evidence < log_empty;
    }
    shown.push_back(std::move(next));
  }
  std::vector<Hypothesis> all;
  double log_other = log_empty;
  if (surprised || modes_.empty() || search_is_due()) {
    since_search_ = 0;
    point.searched = true;
    const std::vector<VectorXd> starts = frame.starts();
    const double share = modes_.empty() ? 1.0 : options_.lost_probability;
    if (!modes_.empty() && !young_.empty()) {
      search_young(starts, shown);
    } else {
      search(frame, starts, share, all);
    }
    // If the frame is not as predicted, a disturbance may explain it as well as a new object.
    for (const Hypothesis& h : all) {
      if (surprised) log_other = log_sum(log_other, h.log_weight - std::log(share));
    }
  }
  for (std::size_t i = 0; i < modes_.size(); ++i) {
    Hypothesis missed;
    missed.log_weight =
        std::log(modes_[i].weight) + std::log(options_.missed_probability) + log_other;
    missed.predicted = missed.filtered = modes_[i].state;
    missed.age = modes_[i].age + 1;
    missed.coasted = modes_[i].coasted + 1;
    missed.log_likelihood = modes_[i].log_likelihood;
    missed.parent = modes_[i].node;
    all.push_back(std::move(missed));
  }
  for (Hypothesis& next : shown) {
    next.log_weight += std::log1p(-options_.missed_probability);
    all.push_back(std::move(next));
  }
  double log_present = -std::numeric_limits<double>::infinity();
  for (const Hypothesis& h : all) log_present = log_sum(log_present, h.log_weight);
  presence_ = 1 / (1 + std::exp(-log_odds(log_present, log_empty)));
  return all;
}

/// Leaves out what weighs next to nothing beside the heaviest.
void Tracker::leave_out_negligible(std::vector<Hypothesis>& hypotheses) const {
  if (hypotheses.empty()) return;
  const double least =
      std::ranges::max_element(hypotheses, {}, &Hypothesis::log_weight)->log_weight +
      std::log(options_.negligible_weight);
  std::erase_if(hypotheses, [&](const Hypothesis& h) { return h.log_weight < least; });
}

/// New hypotheses from the whole search region: those that matter after a rough update get a full
/// one. `share` is their total prior weight.
void Tracker::search(const FrameLikelihood& frame, std::span<const VectorXd> starts, double share,
                     std::vector<Hypothesis>& hypotheses) const {
  const auto born = [&](const std::vector<VectorXd>& places, UpdateFunction update) {
    std::vector<Hypothesis> all(places.size()), distinct;
    parallel_for(std::size_t{0}, places.size(), [&](std::size_t i) {
      const FrameLikelihood::Update at = (frame.*update)(unknown_, places[i], inflation_);
      all[i].log_weight = std::log(share) + at.log_evidence;
      all[i].log_likelihood = at.log_likelihood;
      all[i].predicted = all[i].filtered = at_first(at.posterior);
    });
    // Starts that led to the same optimum are one explanation, not two.
    for (Hypothesis& next : all) {
      if (like(distinct, next) == distinct.end()) distinct.push_back(std::move(next));
    }
    return distinct;
  };
  std::vector<Hypothesis> roughly =
      born({starts.begin(), starts.end()}, &FrameLikelihood::rough_update);
  leave_out_negligible(roughly);
  std::vector<VectorXd> places;
  for (const Hypothesis& h : roughly) places.push_back(h.filtered.mean.head(layout_.measured));
  for (Hypothesis& next : born(places, &FrameLikelihood::update)) {
    if (like(hypotheses, next) == hypotheses.end()) hypotheses.push_back(std::move(next));
  }
}

/// The whole state when an object is first seen.
Gaussian Tracker::at_first(const Gaussian& measured) const {
  Gaussian state;
  state.mean = VectorXd::Zero(layout_.size);
  state.mean.head(layout_.measured) = measured.mean;
  state.covariance = motion_.initial_speed * motion_.initial_speed *
                     MatrixXd::Identity(layout_.size, layout_.size);
  state.covariance.topLeftCorner(layout_.measured, layout_.measured) = measured.covariance;
  return state;
}

/// The state at each frame's time without any of the young track's frames.
std::vector<Gaussian> Tracker::before_young() const {
  std::vector<Gaussian> before{at_first(unknown_)};
  for (std::size_t k = 1; k < young_.size(); ++k) {
    before.push_back(before.back());
    predict(layout_, motion_, young_[k].dt, before.back());
  }
  return before;
}

/// The hypothesis from the latest frame of a young track alone, for an object about `place`.
Tracker::Hypothesis Tracker::judged_by_latest(const std::vector<Gaussian>& before,
                                              const VectorXd& place, UpdateFunction by) const {
  const YoungFrame& frame = young_.back();
  const FrameLikelihood::Update update =
      ((*frame.likelihood).*by)(measured_part(layout_, before.back()), place, frame.inflation);
  Hypothesis next;
  next.log_weight = update.log_evidence;
  next.log_likelihood = update.log_likelihood;
  next.filtered = before.back();
  condition(layout_, update.posterior, next.filtered);
  return next;
}

/// The hypothesis from all frames of a young track, for the object at the place that the latest
/// frame alone gives (`latest`). The frames are added backwards in time. The latest frame shows the
/// most, so each earlier frame is evaluated about a known place. For linear frames the result
/// equals the filter's own. `before` is the result of before_young().
Tracker::Hypothesis Tracker::judged_by_all(const std::vector<Gaussian>& before,
                                           const Hypothesis& latest, UpdateFunction by) const {
  struct Step {
    MatrixXd back;  ///< takes the next frame's state to this frame's
    Gaussian predicted, filtered;
  };
  std::vector<Step> steps{{{}, before.back(), latest.filtered}};
  Hypothesis result = latest;
  Gaussian state = latest.filtered;
  for (std::size_t k = young_.size() - 1; k-- > 0;) {
    Step step;
    // The reversed motion gives the earlier state from the later one.
    const MatrixXd F = transition(layout_, young_[k + 1].dt);
    const MatrixXd& after = before[k + 1].covariance;
    step.back = after.ldlt().solve(F * before[k].covariance).transpose();
    state.mean = before[k].mean + step.back * layout_.difference(before[k + 1].mean, state.mean);
    state.covariance =
        before[k].covariance + step.back * (state.covariance - after) * step.back.transpose();
    symmetrise(state.covariance);
    step.predicted = state;
    const Gaussian prior = measured_part(layout_, state);
    const FrameLikelihood::Update update =
        ((*young_[k].likelihood).*by)(prior, prior.mean, young_[k].inflation);
    condition(layout_, update.posterior, state);
    result.log_weight += update.log_evidence;
    step.filtered = state;
    steps.push_back(std::move(step));
  }
  for (std::size_t k = steps.size(); k-- > 1;) {
    state = smoothed_by(layout_, steps[k].back, steps[k - 1].filtered, steps[k].predicted, state);
  }
  result.log_weight -= log_evidence_young_;
  result.predicted = result.filtered = state;
  result.age = static_cast<int>(young_.size()) - 1;
  return result;
}

/// A young track may have begun at the wrong one of several places, or may lack the right one. All
/// frames since its begin therefore judge where the object may be: roughly at first, then fully
/// where it matters. `places` come from a search of the latest frame. `shown` holds the track's own
/// modes and receives the result.
void Tracker::search_young(std::vector<VectorXd> places, std::vector<Hypothesis>& shown) const {
  const std::size_t searched = places.size();
  for (const Hypothesis& h : shown) places.push_back(h.filtered.mean.head(layout_.measured));
  const std::vector<Gaussian> before = before_young();
  const auto in_parallel = [](std::vector<Hypothesis>& all, const auto& judge) {
    parallel_for(std::size_t{0}, all.size(), [&](std::size_t i) { all[i] = judge(i); });
    std::stable_sort(all.begin(), all.end(), [](const Hypothesis& a, const Hypothesis& b) {
      return a.log_weight > b.log_weight;
    });
  };
  const auto roughly = &FrameLikelihood::rough_update, fully = &FrameLikelihood::update;
  std::vector<Hypothesis> latest(places.size());
  in_parallel(latest, [&](std::size_t i) {
    Hypothesis next = judged_by_latest(before, places[i], roughly);
    if (i >= searched) next.parent = shown[i - searched].parent;
    return next;
  });
  // Places that led to the same optimum would take the same way through the earlier frames. If all
  // places that matter lead to the track's own optima, there is nothing to judge.
  std::vector<Hypothesis> distinct;
  for (Hypothesis& next : latest) {
    const auto known = like(distinct, next);
    if (known == distinct.end()) {
      distinct.push_back(std::move(next));
    } else if (next.parent >= 0) {
      known->parent = next.parent;
    }
  }
  const auto only_own = [&] {
    return std::ranges::all_of(distinct, [](const Hypothesis& h) { return h.parent >= 0; });
  };
  if (only_own()) return;
  std::vector<Hypothesis> candidates = distinct;
  in_parallel(distinct,
              [&](std::size_t i) { return judged_by_all(before, candidates[i], roughly); });
  leave_out_negligible(distinct);
  if (only_own()) return;
  candidates = distinct;
  in_parallel(distinct, [&](std::size_t i) {
    const VectorXd place = candidates[i].filtered.mean.head(layout_.measured);
    return judged_by_all(before, judged_by_latest(before, place, fully), fully);
  });
  std::vector<Hypothesis> result;
  for (Hypothesis& next : distinct) {
    if (like(result, next) != result.end()) continue;
    // A mode that the track already has continues that mode.
    if (const auto own = like(shown, next); own != shown.end()) {
      next.parent = own->parent;
      next.predicted = own->predicted;
      next.age = own->age;
    }
    result.push_back(std::move(next));
  }
  for (Hypothesis& own : shown) {
    if (like(result, own) == result.end()) result.push_back(std::move(own));
  }
  shown = std::move(result);
}

bool Tracker::too_close(const Hypothesis& a, const Hypothesis& b) const {
  const Index n = layout_.size;
  const VectorXd d = layout_.difference(a.filtered.mean, b.filtered.mean);
  const MatrixXd spread = 0.5 * (a.filtered.covariance + b.filtered.covariance);
  return d.head(n).dot(spread.ldlt().solve(d)) < options_.merge_distance2;
}

/// The first of `among` that is too close to `hypothesis` to be a different one; the end if there
/// is none.
std::vector<Tracker::Hypothesis>::iterator Tracker::like(std::vector<Hypothesis>& among,
                                                         const Hypothesis& hypothesis) const {
  return std::ranges::find_if(among, [&](const Hypothesis& h) { return too_close(h, hypothesis); });
}

/// Merges, prunes and normalises the hypotheses. The remaining ones are the modes.
void Tracker::keep(std::vector<Hypothesis> hypotheses) {
  std::stable_sort(
      hypotheses.begin(), hypotheses.end(),
      [](const Hypothesis& a, const Hypothesis& b) { return a.log_weight > b.log_weight; });
  modes_.clear();
  if (hypotheses.empty()) return;
  const double top = hypotheses.front().log_weight;
  std::vector<Hypothesis> kept;
  std::vector<double> weights;
  for (const Hypothesis& next : hypotheses) {
    const double weight = std::exp(next.log_weight - top);
    if (!(weight > options_.negligible_weight)) break;
    const auto known = like(kept, next);
    if (known == kept.end()) {
      if (static_cast<int>(kept.size()) < options_.max_modes) {
        kept.push_back(next);
        weights.push_back(weight);
      }
      continue;
    }
    double& own = weights[static_cast<std::size_t>(known - kept.begin())];
    const double part = weight / (own + weight);
    Gaussian& state = known->filtered;
    const VectorXd d = layout_.difference(state.mean, next.filtered.mean);
    state.mean += part * d;
    state.covariance = (1 - part) * state.covariance + part * next.filtered.covariance +
                       part * (1 - part) * d * d.transpose();
    symmetrise(state.covariance);
    own += weight;
  }
  double total = 0;
  for (const double weight : weights) total += weight;
  log_evidence_young_ += top + std::log(total);
  for (std::size_t i = 0; i < kept.size(); ++i) {
    Hypothesis& h = kept[i];
    Node node;
    node.parent = h.parent;
    node.frame = frames_;
    node.predicted = std::move(h.predicted);
    node.filtered = h.filtered;
    history_.push_back(std::move(node));
    modes_.push_back({weights[i] / total, std::move(h.filtered), h.log_likelihood, h.age, h.coasted,
                      forgotten_nodes_ + static_cast<int>(history_.size()) - 1});
  }
  std::stable_sort(modes_.begin(), modes_.end(),
                   [](const TrackMode& a, const TrackMode& b) { return a.weight > b.weight; });
}

/// Adapts the inflation of the measurement's covariance to the innovations. Their normalised
/// squares should be one per degree of freedom.
void Tracker::adapt(const Innovation& innovation, double dt) {
  if (innovation.freedom < 1) return;
  const double surprise = std::min(innovation.squared / innovation.freedom, kMaxSurprise);
  inflation_ *= std::exp((surprise - 1) * std::min(dt / options_.inflation_time, kMaxElapsed));
  inflation_ = std::clamp(inflation_, 1.0, options_.max_inflation);
}

/// Drops frames before the lag, and their nodes.
void Tracker::forget() {
  if (options_.lag <= 0) return;
  while (static_cast<int>(heaviest_.size()) > options_.lag + 1) heaviest_.pop_front();
  while (!history_.empty() && history_.front().frame < first_kept_frame()) {
    history_.pop_front();
    ++forgotten_nodes_;
  }
}

std::vector<std::optional<Gaussian>> Tracker::smoothed() const {
  std::vector<std::optional<Gaussian>> result(heaviest_.size());
  const auto place = [&](int node) {
    return static_cast<std::size_t>(node_of(node).frame - first_kept_frame());
  };
  for (std::size_t frame = heaviest_.size(); frame-- > 0;) {
    int at = heaviest_[frame];
    if (at < 0 || result[frame]) continue;
    // The end of a chain: no later hypothesis continues this one.
    Gaussian smooth = node_of(at).filtered;
    while (!result[place(at)]) {
      const Node& node = node_of(at);
      result[place(at)] = smooth;
      at = node.parent;
      if (at < forgotten_nodes_) break;
      const Gaussian& before = node_of(at).filtered;
      smooth = smoothed_by(layout_, transition(layout_, node.dt), before, node.predicted, smooth);
    }
  }
  return result;
}

namespace {

/// The pose part of a state for the report: wrapped, and with the model's position error.
void report(const Scene& scene, const Motion& motion, const Gaussian& state, PoseVector& pose,
            MatrixXd& covariance) {
  const auto n = static_cast<Index>(scene.unknowns.size());
  pose = state.mean.head(n);
  wrap_pose(scene, pose);
  covariance = state.covariance.topLeftCorner(n, n);
  for (Index i = 0; i < n; ++i) {
    if (!is_position(scene.unknowns[static_cast<std::size_t>(i)].component)) continue;
    covariance(i, i) += motion.position_error * motion.position_error;
  }
}

PoseMixture mixture_of(const Scene& scene, const Motion& motion, const TrackPoint& point) {
  PoseMixture mixture;
  mixture.presence_probability = point.presence_probability;
  for (const TrackMode& mode : point.modes) {
    PoseMode reported;
    reported.weight = mode.weight;
    report(scene, motion, mode.state, reported.pose, reported.covariance);
    reported.optimum = reported.pose;
    reported.log_likelihood = mode.log_likelihood;
    mixture.modes.push_back(std::move(reported));
  }
  if (!mixture.modes.empty()) set_moments(scene, mixture);
  return mixture;
}

TrackSummary summary_of(const TrackLayout& layout, const TrackPoint& point) {
  TrackSummary summary;
  summary.searched = point.searched;
  summary.innovation = point.innovation.squared;
  summary.freedom = point.innovation.freedom;
  summary.inflation = point.inflation;
  const double none = std::numeric_limits<double>::quiet_NaN();
  summary.velocity = PoseVector::Constant(layout.poses, none);
  summary.amplitude = summary.amplitude_sigma_log = none;
  if (point.modes.empty()) return summary;
  const TrackMode& mode = point.modes.front();
  summary.coasted = mode.coasted;
  for (std::size_t i = 0; i < layout.moving.size(); ++i) {
    summary.velocity[layout.moving[i]] = mode.state.mean[layout.measured + static_cast<Index>(i)];
  }
  if (layout.measured > layout.poses) {
    summary.amplitude = std::exp(mode.state.mean[layout.poses]);
    summary.amplitude_sigma_log = std::sqrt(mode.state.covariance(layout.poses, layout.poses));
  }
  return summary;
}

/// Whether a position lies at a border of the search region. A fit's optimum stays on the border,
/// but the filter moves a mean off it a little; the margin is therefore 1e-3 of the range.
bool at_bound(const Scene& scene, const Gaussian& state) {
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    const Unknown& unknown = scene.unknowns[i];
    const double value = state.mean[static_cast<Index>(i)], margin = 1e-3 * unknown.range();
    if (!is_position(unknown.component)) continue;
    if (value < unknown.lower + margin || value > unknown.upper - margin) return true;
  }
  return false;
}

double milliseconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

}  // namespace

FitResult track_frame(const Fitter& fitter, Tracker& tracker, const Capture& capture, double dt,
                      bool described) {
  const auto start = std::chrono::steady_clock::now();
  FitResult result;
  result.sources = {capture.source};
  result.indices = {capture.index};
  result.truth = capture.truth;
  const std::shared_ptr<const FrameLikelihood> frame = fitter.frame(capture);
  result.time_ms.prepare = milliseconds_since(start);
  const TrackPoint point = tracker.advance(dt, frame);
  result.posterior = mixture_of(fitter.scene(), tracker.motion(), point);
  result.track = summary_of(tracker.layout(), point);
  const double none = std::numeric_limits<double>::quiet_NaN();
  result.goodness_of_fit = {none, none, none, point.inflation};
  if (point.modes.empty()) {
    result.flags.emplace_back("nothing_detected");
  } else {
    const TrackMode& mode = point.modes.front();
    if (described) {
      frame->describe(mode.state.mean.head(tracker.layout().measured), result);
      result.goodness_of_fit.inflation = point.inflation;
    }
    if (point.modes.size() > 1 && mode.weight < kOneMode) result.flags.emplace_back("multimodal");
    if (mode.coasted > 0) result.flags.emplace_back("predicted");
    if (at_bound(fitter.scene(), mode.state)) result.flags.emplace_back("at_bound");
    if (mode.age == 0) result.flags.emplace_back("track_started");
  }
  result.time_ms.total = milliseconds_since(start);
  result.time_ms.refine = result.time_ms.total - result.time_ms.prepare;
  return result;
}

void add_smoothed(const Scene& scene, const Tracker& tracker, std::span<FitResult> results) {
  const std::vector<std::optional<Gaussian>> smoothed = tracker.smoothed();
  const auto first = static_cast<std::size_t>(tracker.first_kept_frame());
  for (std::size_t i = 0; i < smoothed.size() && first + i < results.size(); ++i) {
    std::optional<TrackSummary>& track = results[first + i].track;
    if (!smoothed[i] || !track) continue;
    report(scene, tracker.motion(), *smoothed[i], track->smoothed_pose, track->smoothed_covariance);
  }
}

}  // namespace blindcorner
