// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/fit.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <mutex>
#include <utility>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/run_time.h"
#include "blindcorner/inverse/hints.h"
#include "inverse/fit_options.h"
#include "inverse/likelihood/background_error.h"
#include "inverse/posterior/answer.h"
#include "inverse/posterior/detection.h"
#include "inverse/posterior/fitted_histograms.h"
#include "inverse/posterior/goodness_of_fit.h"
#include "inverse/posterior/mode_merging.h"
#include "inverse/posterior/posterior.h"
#include "inverse/posterior/unexplained_light.h"
#include "inverse/prepared_scenes.h"
#include "inverse/search/basins.h"
#include "inverse/search/refine.h"
#include "inverse/search/sharpen.h"
#include "inverse/tracking/capture_likelihood.h"

namespace blindcorner {
namespace {

/// A joint fit of at least kTimesFew * kFew captures searches with kFew of them. Their search
/// counts if it gains kClear over the empty scene in log posterior, divided by the inflation (a
/// signal-to-noise ratio of sqrt(2 * 100) = 14), and leaves at most kFewOptima optima. The numbers
/// of captures and of optima are by judgement: a search by so few costs at most half of one by all.
constexpr std::size_t kFew = 4, kTimesFew = 2;
constexpr double kClear = 100;
constexpr std::size_t kFewOptima = 8;

/// Number of samples. Up to three unknowns get the options' number; more unknowns get samples in
/// proportion to the cube of their number, because the more directions there are, the more of them
/// may have tails. With half the options' number for two unknowns, ends of a ball's ridges
/// (mirror_wall, 2000 captures) were missed: 0.937 instead of 0.952 of truths were in the 95 %
/// region. With twice as many for the six unknowns of two spheres (10,000 photons), the
/// normalised error is 1.27; with forty times as many it is 1.16. A joint fit of many
/// captures pays for each sample in every capture, so it takes a quarter of the samples.
int samples_for(const FitOptions& options, const Scene& scene, std::size_t captures) {
  const auto n = static_cast<double>(scene.unknowns.size());
  const double dear = captures < kTimesFew * kFew ? 1 : 4;
  return static_cast<int>(options.importance_samples * std::max(std::pow(n / 3, 3), 1.0) / dear);
}

/// Captures whose sensors stand far apart. The first is the farthest from the middle, and each
/// further one is the farthest from those before it. Of equally far ones, the first is taken.
std::vector<std::size_t> spread_out(const Scene& scene, std::span<const Capture> captures,
                                    std::size_t count) {
  std::vector<Eigen::Vector3d> at;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Capture& capture : captures) {
    at.push_back(sensor_placement(scene, &capture).T_world_sensor.translation());
    middle += at.back() / static_cast<double>(captures.size());
  }
  std::vector<double> away;
  for (const Eigen::Vector3d& place : at) away.push_back((place - middle).norm());
  std::vector<std::size_t> chosen;
  while (chosen.size() < count) {
    const auto farthest = std::ranges::max_element(away);
    const auto next = static_cast<std::size_t>(farthest - away.begin());
    for (std::size_t i = 0; i < at.size(); ++i) {
      const double distance = (at[i] - at[next]).norm();
      away[i] = chosen.empty() ? distance : std::min(away[i], distance);
    }
    chosen.push_back(next);
    away[next] = -1;
  }
  std::ranges::sort(chosen);
  return chosen;
}

}  // namespace

struct Fitter::Impl {
  Impl(Scene of_scene, FitOptions with_options)
      : scene(std::move(of_scene)), options(std::move(with_options)), prepared(scene, options) {}

  const Scene scene;
  const FitOptions options;
  PreparedScenes prepared;
  std::once_flag hints_once;
  std::vector<std::string> hints;  ///< about the scene, from the first capture's sensor placement

  void doing(const char* what) const {
    if (options.progress) options.progress(what, 0);
  }

  struct Search {
    std::vector<Refined> optima;  ///< best first
    double negligible = 0;        ///< log posterior below the best that may be dropped
    long renders = 0;             ///< by an objective of its own
  };
  Search search(const PoseObjective& objective, const Scored& scored) const;
  std::optional<Search> search_by_few(std::span<const Capture> captures);
  Search on_all(const PoseObjective& objective, const Search& few) const;

  FitResult fit(std::span<const Capture> captures);
};

/// Every basin that the scored poses lead to, and its optimum on the objective's models.
Fitter::Impl::Search Fitter::Impl::search(const PoseObjective& objective,
                                          const Scored& scored) const {
  const std::vector<Start> starts = choose_starts(objective, scored);
  // The models' own error must not decide which basins are dropped: a better model may give to
  // another basin what the best one lacks of its expected log likelihood.
  constexpr double kAll = std::numeric_limits<double>::infinity();
  const std::vector<Refined> basins =
      merge(objective.compiled(), approach_all(objective, starts), kAll);
  if (basins.empty()) return {};
  Search found;
  found.negligible =
      options.negligible_log_posterior + missed_log_likelihood(objective, basins.front());
  found.optima = with_basins(objective, basins, found.negligible, {});
  if (found.optima.empty()) return {};
  found.optima = look_elsewhere(objective, options, found.negligible, std::move(found.optima));
  found.optima = without_slopes(objective, std::move(found.optima));
  return found;
}

/// The search by a few of many captures, from places far apart. Each step of each descent then
/// costs a model for each of the few captures and not for all. Returns nothing if there are few
/// captures anyway, or if the few do not see the object so clearly that no other place could win.
std::optional<Fitter::Impl::Search> Fitter::Impl::search_by_few(std::span<const Capture> captures) {
  if (captures.size() < kTimesFew * kFew) return std::nullopt;
  std::vector<SensorPlacement> placements;
  std::vector<Capture> few;
  for (const std::size_t i : spread_out(scene, captures, kFew)) {
    few.push_back(captures[i]);
    placements.push_back(sensor_placement(scene, &captures[i]));
  }
  const std::shared_ptr<Prepared> known = prepared.at(placements);
  const Observation observation = observe(*known->compiled, few);
  if (observation.zones.empty() || no_photons(observation)) return std::nullopt;
  const PoseObjective objective(*known->compiled, observation);
  LinearSolution empty;
  const PoseValue nothing = objective.evaluate_empty(empty);
  Search found =
      search(objective, score_all(objective, empty, prepared.near_relay(*known), few, options));
  found.renders = objective.renders();
  if (found.optima.empty()) return std::nullopt;
  const Refined& top = found.optima.front();
  const double inflation = goodness_of_fit(objective, top).inflation;
  const double gain = (top.value.log_posterior - nothing.log_posterior) / inflation;
  // Misfit that costs all places the same makes none of them better.
  const double least = top.value.log_posterior - inflation * options.negligible_log_posterior;
  std::erase_if(found.optima,
                [&](const Refined& other) { return other.value.log_posterior < least; });
  if (found.optima.size() > kFewOptima) return std::nullopt;
  known->count_bytes();
  if (gain < kClear) return std::nullopt;
  return found;
}

/// The optima that the few captures found, found again with all captures.
Fitter::Impl::Search Fitter::Impl::on_all(const PoseObjective& objective, const Search& few) const {
  Search all = few;
  all.optima.clear();
  std::vector<PoseVector> places;
  for (const Refined& optimum : few.optima) places.push_back(optimum.pose);
  constexpr double kAll = std::numeric_limits<double>::infinity();
  all.optima = polish_all(objective, places, kAll);
  if (!all.optima.empty()) {
    all.negligible =
        options.negligible_log_posterior + missed_log_likelihood(objective, all.optima.front());
  }
  return all;
}

/// The method, top to bottom.
FitResult Fitter::Impl::fit(std::span<const Capture> captures) {
  const Stopwatch total;
  Stopwatch stage;
  const auto lap_ms = [&stage] { return 1e3 * std::exchange(stage, {}).since_start().wall; };
  FitResult result;
  std::vector<SensorPlacement> placements;
  for (const Capture& capture : captures) {
    check_capture(scene, capture);
    result.sources.push_back(capture.source);
    result.indices.push_back(capture.index);
    placements.push_back(sensor_placement(scene, &capture));
  }
  if (!captures.empty()) result.truth = captures.front().truth;

  // What no capture changes: models, gates, scored poses.
  std::call_once(hints_once, [&] { hints = scene_hints(scene, placements.front()); });
  result.hints = hints;
  doing("compiling");
  const std::shared_ptr<Prepared> known = prepared.at(placements);
  const CompiledScene& compiled = *known->compiled;
  const Observation observation = observe(compiled, captures);
  PoseObjective objective(compiled, observation);
  result.time_ms.prepare = lap_ms();
  if (observation.zones.empty()) {
    throw Error(captures.front().source, "found no zone with valid bins, accepted: at least one");
  }
  if (no_photons(observation)) {
    answer_darkness(compiled, observation, captures, result);
    result.time_ms.total = 1e3 * total.since_start().wall;
    return result;
  }

  // The scene without an object; every pose on the grid; the best ones refined.
  doing("scoring");
  LinearSolution empty;
  const PoseValue nothing = objective.evaluate_empty(empty);
  const Scored scored = score_all(objective, empty, prepared.near_relay(*known), captures, options);
  result.time_ms.score = lap_ms();
  doing("refining");
  Search found;
  if (auto few = search_by_few(captures)) found = on_all(objective, *few);
  if (found.optima.empty()) found = search(objective, scored);
  if (found.optima.empty()) {
    throw Error(captures.front().source, "found no finite likelihood at any pose");
  }
  std::vector<Refined>& optima = found.optima;
  // Models as good as the light asks for.
  const auto n = static_cast<Eigen::Index>(compiled.unknown_count());
  ModelError model_error{Eigen::MatrixXd::Zero(n, n)};
  if (!options.model_tolerance && options.uses(FitRule::sharpen)) {
    model_error = sharpen(objective, optima, found.negligible);
  }
  if (options.uses(FitRule::shadow)) {
    model_error.covariance += cast_shadow(objective, optima, found.negligible);
  }
  result.time_ms.refine = lap_ms();

  // How sure: goodness of fit, Fisher information, evidences.
  doing("weighing explanations");
  PosteriorOptions sampling;
  sampling.negligible = options.negligible_log_posterior;
  sampling.samples = samples_for(options, scene, captures.size());
  sampling.seed = options.seed;
  sampling.model_error = model_error.covariance;
  sampling.along_axis = options.uses(FitRule::along_axis);
  sampling.ridges = options.uses(FitRule::ridges);
  sampling.local_light = options.uses(FitRule::local_light);
  result.goodness_of_fit = goodness_of_fit(objective, optima.front());
  sampling.inflation = result.goodness_of_fit.inflation;
  const Posterior posterior =
      blindcorner::posterior(objective, optima, &scored, known->moved.get(), sampling);
  result.posterior = posterior.mixture;
  allow_for_outliers(scene, result.posterior);
  const double left_over = unexplained_light(objective, optima.front()).probability();
  result.time_ms.uncertainty = lap_ms();

  // Is there anything at all?
  doing("comparing with empty captures");
  const double log_evidence_empty =
      nothing.log_integrand - nothing.log_likelihood * (1 - 1 / sampling.inflation);
  result.posterior.presence_probability =
      presence_probability(posterior.log_evidence, log_evidence_empty, scene.presence_prior);
  if (options.empty_captures > 0) {
    result.false_alarm_probability = prepared.false_alarms(known).probability(
        objective, empty, options.empty_captures, options.seed);
  }
  result.time_ms.detect = lap_ms();
  known->count_bytes();  // what this capture asked for is there now

  result.renders = objective.renders() + found.renders;

  set_flags(scene, posterior, left_over, result);
  ShapeBuffer at;
  objective.shapes(light_near(objective, optima.front()), optima.front().pose, at);
  for (std::size_t i = 0; i < captures.size(); ++i) {
    result.histograms.push_back(
        fitted_histograms(objective, optima.front(), at, captures[i], static_cast<int>(i)));
  }
  std::ranges::copy(fit_hints(scene, result), std::back_inserter(result.hints));
  if (left_over < kUnexplained) result.hints.push_back(unexplained_hint(left_over));
  if (model_error.too_dear) result.hints.push_back(too_dear_hint());
  result.time_ms.total = 1e3 * total.since_start().wall;
  return result;
}

Fitter::Fitter(Scene scene, FitOptions options) {
  options.validate();
  validate_scene(scene);
  impl_ = std::make_unique<Impl>(std::move(scene), std::move(options));
}
Fitter::~Fitter() = default;
Fitter::Fitter(Fitter&&) noexcept = default;
Fitter& Fitter::operator=(Fitter&&) noexcept = default;

FitResult Fitter::fit(const Capture& capture) const { return impl_->fit({&capture, 1}); }

FitResult Fitter::fit_joint(std::span<const Capture> captures) const {
  if (captures.empty()) throw Error("captures", "found none, accepted: at least one");
  return impl_->fit(captures);
}

std::unique_ptr<FrameLikelihood> Fitter::frame(const Capture& capture) const {
  check_capture(impl_->scene, capture);
  const std::shared_ptr<Prepared> known =
      impl_->prepared.at({sensor_placement(impl_->scene, &capture)});
  return make_capture_likelihood({known, known->compiled.get()}, capture, impl_->options);
}

const Scene& Fitter::scene() const { return impl_->scene; }

FitResult fit(const Scene& scene, const Capture& capture, const FitOptions& options) {
  return Fitter(scene, options).fit(capture);
}

}  // namespace blindcorner
