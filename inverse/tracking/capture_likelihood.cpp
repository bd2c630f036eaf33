// SPDX-License-Identifier: Apache-2.0
#include "inverse/tracking/capture_likelihood.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "inverse/likelihood/background_error.h"
#include "inverse/likelihood/light_slope.h"
#include "inverse/posterior/along_axis.h"
#include "inverse/posterior/fisher_information.h"
#include "inverse/posterior/fitted_histograms.h"
#include "inverse/posterior/goodness_of_fit.h"
#include "inverse/posterior/mode_merging.h"
#include "inverse/search/refine.h"
#include "inverse/search/scoring.h"
#include "inverse/search/sharpen.h"

namespace blindcorner {
namespace {

/// Fisher scoring stops when a step promises less than this in log posterior: a move of 0.06
/// standard deviations. The number of steps, and the number of lengths tried for each (down to a
/// 16th), bound the time, by judgement.
constexpr double kWorthAStep = 2e-3;
constexpr int kMaxSteps = 12;
constexpr int kMaxHalvings = 5;
/// Move of the optimum, in standard deviations, that the model's own error may cause. By judgement:
/// carried as an error, it would widen a standard deviation by 4 %.
constexpr double kSmallMove = 0.3;
/// Squared length of a move, in standard deviations, over which the light's slopes and the
/// correction of a cheap light stay valid. By judgement: slopes then change by a tenth.
constexpr double kSameSlope = 1.0;
/// Most corrections of a cheap light in one descent.
constexpr int kMostCorrections = 4;
/// Level of the finer models that correct the light at the end, and the most paths (lit times seen
/// times object points) that one render of them may sum over: some 100 ms, by judgement.
constexpr int kFiner = 1;
constexpr double kMostPaths = 3e9;
/// Error of the closed form's light as a share of it (L2). On the drives it is mostly 0.06 to 0.25,
/// at the van up to 0.4 and in single frames of the blind turn 0.7.
constexpr double kClosedFormError = 0.15;
/// Bounds of the ratio of a fall to a Gaussian's, by judgement: the lower one makes a posterior
/// three times as wide, the upper one five times as narrow.
constexpr double kLeastFall = 0.1, kMostFall = 25;
/// Error of the log posterior that eliminating the linear unknowns may leave, far below
/// kWorthAStep.
constexpr double kAccuracy = 1e-6;
/// Most starts that are followed when nothing is known, by judgement: one that is missed is looked
/// for again in a later frame (TrackerOptions::search_interval).
constexpr std::size_t kMaxStarts = 6;

bool has_amplitude(const Scene& scene) { return scene.linear.amplitude == LinearMode::shared; }

/// The scene's linear unknowns without a shared amplitude. A shared amplitude is one of the frame's
/// own unknowns: it scales the light and is not eliminated.
LinearUnknowns without_amplitude(const Scene& scene) {
  LinearUnknowns linear = scene.linear;
  if (has_amplitude(scene)) {
    linear.amplitude = LinearMode::fixed;
    linear.fixed_amplitude = 1;
  }
  return linear;
}

class CaptureLikelihood final : public FrameLikelihood {
 public:
  CaptureLikelihood(std::shared_ptr<const CompiledScene> kept, const Capture& capture,
                    const FitOptions& options)
      : kept_(std::move(kept)),
        compiled_(*kept_),
        options_(options),
        capture_(capture),
        observation_(observe(compiled_, {&capture_, 1})),
        objective_(compiled_, observation_),
        solver_(observation_, without_amplitude(compiled_.scene)),
        closed_form_(compiled_.spline == nullptr && !compiled_.coarse.empty()) {
    if (observation_.zones.empty()) {
      throw Error(capture.source, "found no zone with valid bins, accepted: at least one");
    }
    ShapeBuffer nothing;
    objective_.empty_shapes(nothing);
    solver_.solve(nothing.shapes, empty_, false);
  }

  Update update(const Gaussian& prior, const Eigen::VectorXd& start,
                double inflation) const override {
    const bool in_time = options_.known_light == KnownLightSampling::timely;
    const Fitted fitted =
        fit(prior, start, inflation, in_time ? BestLight::models : BestLight::finer);
    const LightSource light = fitted.light.corrected();
    Update result = as_it_falls(light, prior, fitted.best, inflation);
    if (fitted.error >= kSmallMove) {
      result.posterior = less_sure(light, prior, fitted, inflation).posterior;
    }
    return result;
  }

  Update rough_update(const Gaussian& prior, const Eigen::VectorXd& start,
                      double inflation) const override {
    const Fitted fitted =
        fit(prior, start, inflation, closed_form_ ? BestLight::cheap : BestLight::models);
    return less_sure(fitted.light.corrected(), prior, fitted, inflation);
  }

  std::vector<Eigen::VectorXd> starts() const override {
    LinearSolution empty;
    objective_.evaluate_empty(empty);
    const Scored scored =
        score(objective_, empty, options_.max_starts, options_.negligible_log_posterior);
    std::vector<Start> places;
    for (const Candidate& start : scored.starts) {
      if (places.size() < kMaxStarts) places.push_back({start.pose});
    }
    std::vector<Eigen::VectorXd> result;
    const auto add = [&](const PoseVector& pose, const LinearSolution& linear) {
      Eigen::VectorXd at(size());
      at.head(poses()) = pose;
      if (size() > poses()) at[poses()] = std::log(linear.amplitude.front());
      result.push_back(std::move(at));
    };
    if (closed_form_) {
      // A rough update, which costs as little as a descent here would, descends from them.
      for (const Start& place : places) {
        LinearSolution linear;
        objective_.evaluate(LightSource(compiled_.coarse), place.pose, linear, false);
        add(place.pose, linear);
      }
      return result;
    }
    for (const Refined& basin :
         merge(compiled_, approach_all(objective_, places), options_.negligible_log_posterior)) {
      add(basin.pose, basin.linear);
    }
    return result;
  }

  double log_evidence_empty(double inflation) const override {
    return empty_.log_likelihood / inflation + empty_.log_prior + empty_.log_volume;
  }

  Look look(double inflation) const override {
    if (!compiled_.objects().empty() || compiled_.scene.linear.amplitude == LinearMode::per_zone) {
      return {};
    }
    LinearSolution empty;
    objective_.evaluate_empty(empty);
    const MatchedFilter filter(objective_, empty, MatchedFilter::Weights::expected,
                               MatchedFilter::Priors::used);
    // The log posterior of each place at its best amplitude. It is at least the log integral over
    // all amplitudes. Divided by the inflation, it is at least the log posterior under that
    // inflation.
    const Eigen::ArrayXd gain = filter.scores().cast<double>().array() / inflation;
    const Eigen::ArrayXd prior = Eigen::Map<const Eigen::ArrayXf>(compiled_.log_prior.data(),
                                                                  std::ssize(compiled_.log_prior))
                                     .cast<double>();
    const auto log_sum = [](const Eigen::ArrayXd& logs) {
      return logs.maxCoeff() + std::log((logs - logs.maxCoeff()).exp().sum());
    };
    const double evidence = log_sum(gain + prior) - log_sum(prior);
    const Eigen::ArrayXd posterior = (gain + prior - log_sum(gain + prior)).exp();
    return {log_evidence_empty(inflation) + evidence, (posterior * gain).sum() - evidence};
  }

  void describe(const Eigen::VectorXd& at, FitResult& result) const override {
    Refined fitted;
    fitted.pose = at.head(poses());
    ShapeBuffer light;
    fill(compiled_.models(), at, light);
    solver_.solve(light.shapes, fitted.linear, false);
    fitted.value.log_likelihood = fitted.linear.log_likelihood;
    if (size() > poses()) {
      std::fill(fitted.linear.amplitude.begin(), fitted.linear.amplitude.end(),
                std::exp(at[poses()]));
    }
    result.goodness_of_fit = goodness_of_fit(objective_, fitted);
    objective_.shapes(compiled_.models(), fitted.pose, light);
    result.histograms.push_back(fitted_histograms(objective_, fitted, light, capture_, 0));
  }

 private:
  struct State {
    Eigen::VectorXd at;
    LinearSolution linear;
    double log_posterior = -std::numeric_limits<double>::infinity();
    Eigen::MatrixXd covariance;
    double signal = 0;  ///< squared signal-to-noise ratio of the light; 0 where it is no unknown
  };
  /// Inverse covariance of a prior, and the logarithm of the prior's density at its mean.
  struct PriorNorm {
    explicit PriorNorm(const Gaussian& prior)
        : precision(prior.covariance.llt().solve(
              Eigen::MatrixXd::Identity(prior.mean.size(), prior.mean.size()))),
          log(-0.5 * (static_cast<double>(prior.mean.size()) * std::log(2 * kPi) +
                      log_determinant(prior.covariance))) {}
    Eigen::MatrixXd precision;
    double log;
  };
  Eigen::Index poses() const { return compiled_.unknown_count(); }
  Eigen::Index size() const { return poses() + (has_amplitude(compiled_.scene) ? 1 : 0); }
  double amplitude(const Eigen::VectorXd& at) const {
    return size() > poses() ? std::exp(at[poses()]) : 1.0;
  }

  static double log_determinant(const Eigen::MatrixXd& covariance) {
    const Eigen::MatrixXd root = covariance.llt().matrixL();
    return 2 * root.diagonal().array().log().sum();
  }

  /// Expected light at a state, amplitude included.
  void fill(const LightSource& source, const Eigen::VectorXd& at, ShapeBuffer& light) const {
    const PoseVector pose = at.head(poses());
    objective_.shapes(source, pose, light);
    const double a = amplitude(at);
    for (double& value : light.object) value *= a;
  }

  /// A cheap light, and its correction by a better one near a pose.
  struct CheapLight {
    LightSource source;
    Correction correction;
    LightSource corrected() const { return source.corrected(correction); }
  };

  void correct(CheapLight& cheap, const ModelSet& models, const Eigen::VectorXd& at) const {
    const PoseVector pose = at.head(poses());
    ShapeBuffer right;
    ShapeBuffer rough;
    objective_.shapes(models, pose, right);
    objective_.shapes(cheap.source, pose, rough);
    cheap.correction = objective_.correction(right, rough);
  }

  /// Descends on a cheap light. The light is corrected and the descent repeated until it hardly
  /// moves, so that the light is that of the models at the optimum.
  State descend_corrected(CheapLight& cheap, const ModelSet& models, const Gaussian& prior,
                          State state, double inflation) const {
    for (int i = 0; i < kMostCorrections; ++i) {
      correct(cheap, models, state.at);
      State next = descend(cheap.corrected(), prior, state.at, inflation);
      const double moved = squared_distance(next, state.at);
      state = std::move(next);
      if (moved < kSameSlope) break;
    }
    return state;
  }

  /// Squared distance from a state's optimum to `from`, in the state's standard deviations.
  double squared_distance(const State& state, const Eigen::VectorXd& from) const {
    const Eigen::VectorXd d = from_mean({from, {}}, state.at);
    return d.dot(state.covariance.ldlt().solve(d));
  }

  /// A descent's end, the light there, and how far the light's own error may move the end, in
  /// standard deviations.
  struct Fitted {
    State best;
    CheapLight light;
    double error;
  };

  /// The best light that a descent may ask for.
  enum class BestLight { cheap, models, finer };

  /// The spline, or the closed form. Without either, the models themselves.
  CheapLight cheap_light() const {
    if (compiled_.spline) return {LightSource(*compiled_.spline), {}};
    if (closed_form_) return {LightSource(compiled_.coarse), {}};
    return {LightSource(compiled_.models()), {}};
  }

  /// Descends on a cheap light. Where its error may move the optimum, the models correct it, and
  /// where theirs may, finer models do: the error is much the same in all frames, so that no number
  /// of frames averages it out.
  Fitted fit(const Gaussian& prior, const Eigen::VectorXd& start, double inflation,
             BestLight most) const {
    const bool spline = compiled_.spline != nullptr;
    const bool exact = compiled_.knowledge->coarse() == nullptr;  // measured laws
    Fitted fitted{{}, cheap_light(), 0};
    State& best = fitted.best;
    CheapLight& light = fitted.light;
    best.at = start;
    clamp(best.at);
    best = descend(light.source, prior, best.at, inflation);
    if (closed_form_) {
      fitted.error = kClosedFormError * std::sqrt(best.signal);
      if (most == BestLight::cheap || fitted.error < kSmallMove) return fitted;
      best = descend_corrected(light, compiled_.models(), prior, best, inflation);
    }
    const auto error_of = [&](int level) {
      return exact ? 0.0 : light_error(compiled_.scene, level) * std::sqrt(best.signal);
    };
    fitted.error = error_of(0);
    const ModelSet* finer = most == BestLight::finer && fitted.error > kSmallMove
                                ? compiled_.models_within(kFiner, kMostPaths)
                                : nullptr;
    if (spline || finer != nullptr) {
      best = descend_corrected(light, finer != nullptr ? *finer : compiled_.models(), prior, best,
                               inflation);
      fitted.error = error_of(finer != nullptr ? kFiner : 0);
    }
    return fitted;
  }

  /// The update for which the frame counts for less by the error of its light, also when places are
  /// compared.
  Update less_sure(const LightSource& light, const Gaussian& prior, const Fitted& fitted,
                   double inflation) const {
    if (fitted.error < kSmallMove) return as_it_falls(light, prior, fitted.best, inflation);
    const double wider = inflation * (1 + fitted.error * fitted.error);
    const State uncertain = descend(light, prior, fitted.best.at, wider);
    Update result = as_it_falls(light, prior, uncertain, wider);
    result.log_evidence += log_evidence_empty(inflation) - log_evidence_empty(wider);
    return result;
  }

  /// The posterior about an optimum. Along a principal axis on which it falls like the Gaussian of
  /// the expected information, it is that Gaussian. Along other axes it gets the moments of the
  /// fall that is found there, as if the posterior were a product over the axes. Dim light leaves
  /// more unknown than its expected information says. Outside the search region, where the fall
  /// cannot be evaluated, it is taken for the Gaussian's.
  Update as_it_falls(const LightSource& light, const Gaussian& prior, const State& best,
                     double inflation) const {
    const Eigen::Index n = best.at.size();
    Update result;
    result.posterior.mean = best.at;
    result.posterior.covariance = best.covariance;
    result.log_likelihood = best.linear.log_likelihood;
    result.log_evidence = best.log_posterior + 0.5 * static_cast<double>(n) * std::log(2 * kPi) +
                          0.5 * log_determinant(best.covariance);
    const PriorNorm norm(prior);
    ShapeBuffer buffer;
    State state = best;
    const auto ratio = [&](const Eigen::VectorXd& axis, double away) {
      state.at = best.at + away * axis;
      if (!inside(state.at) || goes_round(away * axis)) return 1.0;
      evaluate(light, prior, norm, inflation, state, buffer);
      const double fall = (best.log_posterior - state.log_posterior) / (0.5 * away * away);
      return std::clamp(fall, kLeastFall, kMostFall);
    };
    const Eigen::MatrixXd axes = principal_deviations(best.covariance);
    for (Eigen::Index i = 0; i < n; ++i) {
      FallRatios ratios;
      ratios.fill(1);
      const auto look_at = [&](double distance) {
        for (std::size_t k = 0; k < kAway.size(); ++k) {
          if (std::abs(kAway[k]) == distance) ratios[k] = ratio(axes.col(i), kAway[k]);
        }
      };
      look_at(kSigmaPoint);
      if (falls_like_gaussian(ratios)) continue;
      look_at(kTailPoint);
      const AlongAxis along = integrate_along(ratios);
      result.posterior.mean += along.mean * axes.col(i);
      result.posterior.covariance += (along.variance - 1) * axes.col(i) * axes.col(i).transpose();
      result.log_evidence += std::log(along.mass);
    }
    wrap(result.posterior.mean);
    return result;
  }

  Eigen::VectorXd from_mean(const Gaussian& prior, const Eigen::VectorXd& at) const {
    Eigen::VectorXd d = at - prior.mean;
    d.head(poses()) = pose_difference(compiled_.scene, prior.mean.head(poses()), at.head(poses()));
    return d;
  }

  bool inside(const Eigen::VectorXd& at) const {
    Eigen::VectorXd clamped = at;
    clamp(clamped);
    return clamped == at;
  }

  /// Whether a way leads more than half around a circle: what is there is counted from the other
  /// side.
  bool goes_round(const Eigen::VectorXd& way) const {
    for (std::size_t i = 0; i < compiled_.scene.unknowns.size(); ++i) {
      const double period = period_of(compiled_.scene, i);
      if (period > 0 && std::abs(way[static_cast<Eigen::Index>(i)]) > period / 2) return true;
    }
    return false;
  }

  void wrap(Eigen::VectorXd& at) const {
    PoseVector pose = at.head(poses());
    wrap_pose(compiled_.scene, pose);
    at.head(poses()) = pose;
  }

  /// Keeps a state inside the search region.
  void clamp(Eigen::VectorXd& at) const {
    for (std::size_t i = 0; i < compiled_.scene.unknowns.size(); ++i) {
      if (period_of(compiled_.scene, i) > 0) continue;
      const Unknown& unknown = compiled_.scene.unknowns[i];
      double& value = at[static_cast<Eigen::Index>(i)];
      value = std::clamp(value, unknown.lower, unknown.upper);
    }
  }

  /// Computes the log posterior of a state, and fills `light`.
  void evaluate(const LightSource& source, const Gaussian& prior, const PriorNorm& norm,
                double inflation, State& state, ShapeBuffer& light) const {
    fill(source, state.at, light);
    solver_.solve(light.shapes, state.linear, !state.linear.ambient.empty(), kAccuracy);
    const Eigen::VectorXd d = from_mean(prior, state.at);
    state.log_posterior = state.linear.log_likelihood / inflation + state.linear.log_prior +
                          state.linear.log_volume + norm.log - 0.5 * d.dot(norm.precision * d);
  }

  /// Gradient of the log likelihood and expected information, with the zones' own linear unknowns
  /// eliminated. `unit_slope` is the slope of the light at unit amplitude with respect to the pose.
  void linearise(const State& state, const ShapeBuffer& light, const Eigen::MatrixXd& unit_slope,
                 Eigen::VectorXd& gradient, Eigen::MatrixXd& information) const {
    Eigen::MatrixXd slope(objective_.rows(), size());
    slope.leftCols(poses()) = amplitude(state.at) * unit_slope;
    if (size() > poses()) {
      slope.rightCols(1) =
          Eigen::Map<const Eigen::VectorXd>(light.object.data(), objective_.rows());
    }
    information = fisher_information(solver_, light.shapes, state.linear, slope, &gradient);
  }

  /// Fisher scoring, damped by halving steps that lead downhill.
  State descend(const LightSource& source, const Gaussian& prior, const Eigen::VectorXd& start,
                double inflation) const {
    const Eigen::Index n = size();
    const PriorNorm norm(prior);
    State state;
    state.at = start;
    state.linear = empty_;  // right for all zones that the object does not light
    clamp(state.at);
    ShapeBuffer light;
    evaluate(source, prior, norm, inflation, state, light);
    Eigen::MatrixXd slope;
    double moved = std::numeric_limits<double>::infinity();  // since `slope`, squared
    for (int i = 0; i < kMaxSteps; ++i) {
      Eigen::VectorXd gradient;
      Eigen::MatrixXd information;
      if (moved > kSameSlope) {
        slope = light_slope(objective_, source, state.at.head(poses()));
        moved = 0;
      }
      linearise(state, light, slope, gradient, information);
      if (n > poses()) state.signal = information(n - 1, n - 1);
      const Eigen::LDLT<Eigen::MatrixXd> curvature(information / inflation + norm.precision);
      gradient = gradient / inflation - norm.precision * from_mean(prior, state.at);
      state.covariance = curvature.solve(Eigen::MatrixXd::Identity(n, n));
      state.covariance = 0.5 * (state.covariance + state.covariance.transpose().eval());
      const Eigen::VectorXd step = curvature.solve(gradient);
      if (0.5 * step.dot(gradient) < kWorthAStep) break;
      State next = state;
      double scale = 1;
      for (int half = 0; half < kMaxHalvings; ++half, scale *= 0.5) {
        next.at = state.at + scale * step;
        clamp(next.at);
        evaluate(source, prior, norm, inflation, next, light);
        if (next.log_posterior > state.log_posterior) break;
      }
      if (!(next.log_posterior > state.log_posterior)) break;
      const double gain = next.log_posterior - state.log_posterior;
      moved += squared_distance(next, state.at);
      state = std::move(next);
      if (gain < kWorthAStep) break;
    }
    wrap(state.at);
    return state;
  }

  const std::shared_ptr<const CompiledScene> kept_;
  const CompiledScene& compiled_;
  const FitOptions options_;
  const Capture capture_;
  const Observation observation_;
  const PoseObjective objective_;
  const LinearSolver solver_;
  /// No spline, and CompiledScene::coarse is there: the closed form is the cheap light.
  const bool closed_form_;
  LinearSolution empty_;
};

}  // namespace

std::unique_ptr<FrameLikelihood> make_capture_likelihood(
    std::shared_ptr<const CompiledScene> compiled, const Capture& capture,
    const FitOptions& options) {
  return std::make_unique<CaptureLikelihood>(std::move(compiled), capture, options);
}

}  // namespace blindcorner
