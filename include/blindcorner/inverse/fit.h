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

namespace blindcorner {

/// What a fit does beyond one descent and Laplace's approximation, so that its worth can be
/// measured.
enum class FitRule {
  turn,         ///< looks for a better place of the best optimum, turned
  rearrange,    ///< of several objects, for a better place of each while the others stay
  sharpen,      ///< goes to finer models of the light
  shadow,       ///< lets the object stand in the way of the known scene's later bounces
  along_axis,   ///< where no sampling is needed, moments of how the posterior falls along axes
  ridges,       ///< components along posteriors that bend
  local_light,  ///< samples evaluated with a polynomial of the light
};

/// The rules' names, for users: as above.
const std::vector<std::pair<FitRule, std::string>>& fit_rules();

/// How hard the solver tries. The defaults are for use; change them to trade time for safety.
struct FitOptions {
  /// Tolerated error of the fast model relative to the peak of the three-bounce signal. Empty: it
  /// follows from each capture, so that the model's error stays small against the photon noise, and
  /// what is left of it enters the covariance.
  std::optional<double> model_tolerance;
  /// Most poses scored exhaustively before refinement. The pulse is widened when the search region
  /// would need more of them. In closed form, a pose costs microseconds for each sensor placement.
  /// By judgement between time (seconds once for a scene, some milliseconds for a placement) and
  /// narrow pulses.
  int max_scored_poses = 20'000;
  int max_closed_form_poses = 600;
  /// Captures to expect of each sensor placement. Where they are many, tables of exact histograms
  /// are worth their seconds; else poses are scored in closed form.
  int captures_per_placement = 1;
  /// Most memory for compiled sensor placements, bytes; the least recently used go first. By
  /// judgement: some placements of a sensor that moves, which never come again.
  std::size_t cache_bytes = 48'000'000;
  /// Most candidates that the scored poses give: the model looks at them, and descents start from
  /// the best; for measured laws and on splines, from all. By judgement, a limit of the time for
  /// scenes with many local optima.
  int max_starts = 24;
  /// A candidate or mode is dropped when its log posterior is this far below the best one: even a
  /// thousand of them hold less than a per cent (exp(-12) = 6e-6).
  double negligible_log_posterior = 12.0;
  /// Samples of the importance sampler that replaces Laplace's approximation where that fails, for
  /// three unknowns; more get them in proportion to the cube of their number, fewer half of them,
  /// and joint fits of eight captures and more a quarter. 0 keeps Laplace everywhere. A quarter of
  /// them is effective (64), by which a variance is known to 18 %.
  int importance_samples = 256;
  /// Empty captures simulated per scene to calibrate the false-alarm probability; 0: leave it out.
  /// By 128 the scale of the largest score's law is known to a tenth.
  int empty_captures = 128;
  std::uint64_t seed = 1;
  /// Rules that are left out, for measuring what they are worth.
  std::vector<FitRule> left_out;
  bool uses(FitRule rule) const { return std::ranges::find(left_out, rule) == left_out.end(); }
  /// Called as a fit goes on, from any thread: what is being done, and which share of that is done.
  std::function<void(const char* doing, double share)> progress;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Deviance at the best fit against its expectation for the actual, possibly small, counts.
struct GoodnessOfFit {
  double deviance = 0.0;
  double expected = 0.0;            ///< its mean when the model is right
  double standard_deviation = 0.0;  ///< its spread when the model is right
  double inflation = 1.0;           ///< factor by which covariances were multiplied
};

/// Wall-clock times of one fit, ms.
struct StageTimes {
  double prepare = 0.0;      ///< compiling scene and templates (shared ones: 0 after the first)
  double score = 0.0;        ///< exhaustive scoring
  double refine = 0.0;       ///< nonlinear least squares
  double uncertainty = 0.0;  ///< Fisher information, importance sampling
  double detect = 0.0;       ///< presence and false alarms
  double total = 0.0;
};

/// The best fit of one capture, for looking at.
struct FittedHistograms {
  HistogramCube measured;          ///< counts
  HistogramCube model;             ///< expected counts, all terms
  HistogramCube object;            ///< of these, the light that visited the hidden object
  std::vector<bool> zone_used;     ///< [zones]
  int first_bin = 0, end_bin = 0;  ///< bins that entered the likelihood
  std::vector<double> amplitude;   ///< [zones] fitted scale of the object's light
  std::vector<double> ambient;     ///< [zones] counts per bin
  std::vector<double> direct;      ///< [zones] scale of the static return
};

/// What a tracker adds to the answer of one frame.
struct TrackSummary {
  double time = 0.0;               ///< s, since the first frame
  PoseVector velocity;             ///< [unknowns] per s; NaN where the tracker has none
  double amplitude = 0.0;          ///< of the heaviest mode; NaN where it is no state
  double amplitude_sigma_log = 0;  ///< standard deviation of its natural logarithm
  int coasted = 0;                 ///< frames in a row in which the object was only predicted
  bool searched = false;           ///< the whole region was searched
  double innovation = 0.0;         ///< normalised innovation squared
  double freedom = 0.0;            ///< its expectation
  double inflation = 1.0;          ///< of the measurement's covariance, from earlier innovations
  /// With the frames that came after; empty where nothing was tracked.
  PoseVector smoothed_pose;
  Eigen::MatrixXd smoothed_covariance;
};

/// What a fit returns. A joint fit lists all its captures.
struct FitResult {
  std::vector<std::string> sources;
  std::vector<int> indices;
  PoseMixture posterior;
  /// Of an empty scene looking at least this much like one with an object; empty when it was not
  /// asked for.
  std::optional<double> false_alarm_probability;
  GoodnessOfFit goodness_of_fit;
  std::vector<std::string> flags;  ///< documented words
  std::vector<std::string> hints;  ///< sentences on what is odd, and what to do about it
  std::map<std::string, double> truth;
  std::string error;  ///< empty when the fit went well
  StageTimes time_ms;
  long renders = 0;  ///< histograms of one capture rendered by fast models, rough ones included
  std::vector<FittedHistograms> histograms;  ///< per capture
  std::optional<TrackSummary> track;         ///< of a tracker
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

  /// One object seen in all captures, from different sensor poses. Thread safe.
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
