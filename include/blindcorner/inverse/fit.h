// SPDX-License-Identifier: Apache-2.0
/// The facade: histograms in, pose with uncertainty out.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "blindcorner/forward/scene/pose_mixture.h"
#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/forward/transport/forward_model.h"

namespace blindcorner {

/// Steps of a fit beyond one descent and Laplace's approximation. Each can be left out to measure
/// its worth.
enum class FitRule {
  turn,        ///< searches again from the best optimum, turned
  rearrange,   ///< with several objects, searches for a better place of each while the others stay
  sharpen,     ///< switches to finer models of the light
  shadow,      ///< lets the object block later bounces of the known scene
  along_axis,  ///< where no sampling is needed, takes moments of how the posterior falls along axes
  ridges,      ///< adds mixture components along posteriors that bend
  local_light,  ///< evaluates samples with a polynomial of the light
};

/// The rules with their names for users, as above.
const std::vector<std::pair<FitRule, std::string>>& fit_rules();

/// Effort of the solver. The defaults are for normal use; change them to trade time for safety.
struct FitOptions {
  /// Tolerated error of the fast model relative to the peak of the three-bounce signal. Empty: the
  /// tolerance follows from each capture, so that the model's error stays small against the photon
  /// noise. The rest of the error then enters the covariance.
  std::optional<double> model_tolerance;
  /// Sampling of the known scene's light. In place of `usual`, bright captures ask for `fine`. With
  /// `timely`, tracks do without finer models of the object's light: a frame whose light the usual
  /// ones do not give well enough counts for less.
  KnownLightSampling known_light = KnownLightSampling::usual;
  /// Most poses that are scored exhaustively before refinement. The pulse is widened when the
  /// search region would need more poses. In closed form, a pose costs microseconds for each sensor
  /// placement. The values are a judgement between time (seconds once for a scene, some
  /// milliseconds for a placement) and narrow pulses.
  int max_scored_poses = 20'000;
  int max_closed_form_poses = 600;
  /// Expected number of captures for each sensor placement. For many captures, tables of exact
  /// histograms are worth the seconds they take; else poses are scored in closed form.
  int captures_per_placement = 1;
  /// Most memory for compiled sensor placements, bytes; the least recently used are dropped first.
  /// By judgement: some placements of a moving sensor, which never come again.
  std::size_t cache_bytes = 48'000'000;
  /// Most candidates from the scored poses. The model evaluates them, and descents start from the
  /// best; for measured laws and on splines, descents start from all. By judgement, to limit the
  /// time for scenes with many local optima.
  int max_starts = 24;
  /// A candidate or mode is dropped when its log posterior is this far below the best one. Even a
  /// thousand of them hold less than a per cent (exp(-12) = 6e-6).
  double negligible_log_posterior = 12.0;
  /// Samples of the importance sampler that replaces Laplace's approximation where it fails, for up
  /// to three unknowns. More unknowns get samples in proportion to the cube of their number, and
  /// joint fits of eight captures and more get a quarter. 0 keeps Laplace everywhere. A quarter of
  /// the samples is effective (64), which gives a variance to 18 %.
  int importance_samples = 256;
  /// Empty captures simulated per scene to calibrate the false-alarm probability; 0: it is left
  /// out. With 128, the scale of the largest score's law is known to a tenth.
  int empty_captures = 128;
  std::uint64_t seed = 1;
  /// Rules to leave out, for measuring what they are worth.
  std::vector<FitRule> left_out;
  bool uses(FitRule rule) const { return std::ranges::find(left_out, rule) == left_out.end(); }
  /// Called during a fit, from any thread, with the present stage and the share of it that is done.
  std::function<void(const char* doing, double share)> progress;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Deviance at the best fit against its expectation for the actual, possibly small, counts.
struct GoodnessOfFit {
  double deviance = 0.0;
  double expected = 0.0;            ///< mean of the deviance when the model is right
  double standard_deviation = 0.0;  ///< spread of the deviance when the model is right
  double inflation = 1.0;           ///< factor by which covariances were multiplied
};

/// Wall-clock times of one fit, ms.
struct StageTimes {
  double prepare = 0.0;      ///< compiling scene and templates (shared ones: 0 after the first fit)
  double score = 0.0;        ///< exhaustive scoring
  double refine = 0.0;       ///< nonlinear least squares
  double uncertainty = 0.0;  ///< Fisher information, importance sampling
  double detect = 0.0;       ///< presence and false alarms
  double total = 0.0;
};

/// The best fit of one capture, for display.
struct FittedHistograms {
  HistogramCube measured;          ///< counts
  HistogramCube model;             ///< expected counts, all terms
  HistogramCube object;            ///< the part of these that visited the hidden object
  std::vector<bool> zone_used;     ///< [zones]
  int first_bin = 0, end_bin = 0;  ///< range of bins that entered the likelihood
  std::vector<double> amplitude;   ///< [zones] fitted scale of the object's light
  std::vector<double> ambient;     ///< [zones] counts per bin
  std::vector<double> direct;      ///< [zones] scale of the static return
};

/// Additional results of a tracker for one frame.
struct TrackSummary {
  double time = 0.0;               ///< s, since the first frame
  PoseVector velocity;             ///< [unknowns] per s; NaN where the tracker has none
  double amplitude = 0.0;          ///< of the heaviest mode; NaN where the state has no amplitude
  double amplitude_sigma_log = 0;  ///< standard deviation of its natural logarithm
  int coasted = 0;                 ///< consecutive frames in which the object was only predicted
  bool searched = false;           ///< the whole region was searched
  double innovation = 0.0;         ///< normalised innovation squared
  double freedom = 0.0;            ///< expectation of `innovation`
  double inflation = 1.0;  ///< factor on the measurement's covariance, from earlier innovations
  /// Estimates that include the later frames; empty where nothing was tracked.
  PoseVector smoothed_pose;
  Eigen::MatrixXd smoothed_covariance;
};

/// Result of a fit. A joint fit lists all its captures.
struct FitResult {
  std::vector<std::string> sources;
  std::vector<int> indices;
  PoseMixture posterior;
  /// Probability that an empty scene looks at least this much like one with an object; empty when
  /// it was not asked for.
  std::optional<double> false_alarm_probability;
  GoodnessOfFit goodness_of_fit;
  std::vector<std::string> flags;  ///< documented words
  std::vector<std::string> hints;  ///< sentences about what is odd, and what to do about it
  std::map<std::string, double> truth;
  std::string error;  ///< empty when the fit succeeded
  StageTimes time_ms;
  long renders = 0;  ///< histograms of one capture rendered by fast models, rough ones included
  std::vector<FittedHistograms> histograms;  ///< per capture
  std::optional<TrackSummary> track;         ///< set by a tracker
};

class FrameLikelihood;

/// Fits captures of one scene. Compiled models are kept between calls and shared by threads.
class Fitter {
 public:
  explicit Fitter(Scene scene, FitOptions options = {});
  ~Fitter();
  Fitter(Fitter&&) noexcept;
  Fitter& operator=(Fitter&&) noexcept;

  /// Pose of the hidden object from one capture. Throws Error when the capture does not suit the
  /// scene (zones, bins, values that are not counts). Thread safe.
  FitResult fit(const Capture& capture) const;

  /// Pose of one object that all captures see, from different sensor poses. Thread safe.
  FitResult fit_joint(std::span<const Capture> captures) const;

  /// The likelihood of one capture, for a tracker. The fitter must outlive it. Thread safe.
  std::unique_ptr<FrameLikelihood> frame(const Capture& capture) const;

  const Scene& scene() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// One-call form of Fitter for a single capture.
FitResult fit(const Scene& scene, const Capture& capture, const FitOptions& options = {});

}  // namespace blindcorner
