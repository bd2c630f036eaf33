// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/coverage_study.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/bound/error_bound.h"
#include "blindcorner/inverse/posterior/evaluation.h"
#include "blindcorner/simulation/reliability_diagram.h"
#include "forward/support/quantile.h"

namespace blindcorner {
namespace {

constexpr double kRegions[] = {0.5, 0.9, 0.95};
constexpr double kWarnedRegion = 0.95;
/// A mode is the right one if the truth lies in this region of it. The region is that of Student's
/// t with the mode's moments, because a skewed or bent mode may be the right one, too. The regions
/// of the mixture tell whether the shape of the modes is right.
constexpr double kModeRegion = 0.999, kModeFreedom = 5;
constexpr int kWeightBins = 10;
/// Bins with fewer statements are left out, because they say nothing.
constexpr int kMinStatements = 10;
constexpr std::uint64_t kTrialSeed = 1'000'003;
/// Share of right captures that the best test flags: about as many as the fit's own flags together.
constexpr double kBestTestAlarms = 0.01;
/// Objects whose light is rendered with half of the sampling, too. So many are enough to warn, for
/// a per cent of the time of 2000 captures.
constexpr int kTruthChecks = 24;
/// kTruthSamplings: samplings to choose from for a truth as dense as it must be, in units of the
/// wanted one. kDenser: the step from one sampling to the next, which takes up to eight times as
/// long. kDenseChecks: objects by which one is chosen. By judgement of time.
constexpr std::array kTruthSamplings{0.5, 0.7, 1.0, 1.4};
constexpr double kDenser = 1.4;
constexpr int kDenseChecks = 6;

std::string percent(const char* pattern, double a, double b = 0) {
  char text[96];
  std::snprintf(text, sizeof text, pattern, 100 * a, 100 * b);
  return text;
}

/// The truth's log density under a mode's share, and its squared Mahalanobis distance from the
/// mode.
struct ModeAtTruth {
  double log_density = 0, square = 0;
};
ModeAtTruth at_truth(const Scene& scene, const PoseMode& mode, const PoseVector& truth) {
  const Eigen::LLT<Eigen::MatrixXd> factor(mode.covariance);
  const PoseVector d = pose_error(scene, mode.pose, truth);
  const double square = factor.matrixL().solve(d).squaredNorm();
  const double half_log_determinant = factor.matrixLLT().diagonal().array().log().sum();
  return {std::log(mode.weight) - half_log_determinant - 0.5 * square, square};
}

/// The mode that the truth belongs to; none where it is in no mode's region.
std::optional<std::size_t> right_mode(const Scene& scene, const PoseMixture& posterior,
                                      const PoseVector& truth) {
  const auto n = static_cast<double>(truth.size());
  const boost::math::fisher_f_distribution<double> ratio(n, kModeFreedom);
  const double region =
      boost::math::quantile(ratio, kModeRegion) * n * (kModeFreedom - 2) / kModeFreedom;
  double best = -std::numeric_limits<double>::infinity();
  std::optional<std::size_t> right;
  for (std::size_t i = 0; i < posterior.modes.size(); ++i) {
    const ModeAtTruth at = at_truth(scene, posterior.modes[i], truth);
    if (!(at.log_density > best) || at.square > region) continue;
    best = at.log_density;
    right = i;
  }
  return right;
}

double share_where(std::span<const ClaimTrial> trials, const auto& condition) {
  if (trials.empty()) return 0;
  return static_cast<double>(std::ranges::count_if(trials, condition)) /
         static_cast<double>(trials.size());
}

std::vector<double> values_of(std::span<const ClaimTrial> trials, double ClaimTrial::*member) {
  std::vector<double> values;
  for (const ClaimTrial& t : trials) {
    if (t.error.empty()) values.push_back(t.*member);
  }
  return values;
}

bool held(const ClaimTrial& trial, double region) {
  return trial.error.empty() && trial.level <= region;
}

/// Claims of weights, one for each bin. A mode of weight one is claimed to hold the truth only with
/// the probability of its region.
void add_weight_claims(std::span<const ClaimTrial> trials, std::vector<ClaimTest>& claims) {
  ReliabilityDiagram diagram(kWeightBins);
  for (const ClaimTrial& trial : trials) {
    for (const ModeClaim& mode : trial.modes) diagram.add(std::min(mode.weight, 1.0), mode.right);
  }
  for (const ReliabilityBin& bin : diagram.bins()) {
    if (bin.statements < kMinStatements) continue;
    claims.push_back({percent("modes of weight %.0f to %.0f %%", bin.lower, bin.upper),
                      ClaimKind::share, kModeRegion * bin.mean_predicted, bin.observed,
                      bin.statements});
  }
}

/// The first posterior that says that there are several places. If there is none, the first one
/// that says that a direction is open.
std::optional<AmbiguousExample> ambiguous_example(const Fitter& fitter,
                                                  std::span<const DrawnObject> objects,
                                                  std::span<const ClaimTrial> trials,
                                                  const Exposure& exposure, std::uint64_t seed) {
  for (const char* flag : {"multimodal", "undetermined"}) {
    for (std::size_t i = 0; i < trials.size(); ++i) {
      if (!trials[i].has(flag) || trials[i].has("nothing_detected")) continue;
      const FitResult result =
          fitter.fit(capture_of(fitter.scene(), objects[i], exposure, seed + kTrialSeed * (i + 1)));
      return AmbiguousExample{objects[i].pose, result.posterior, result.flags};
    }
  }
  return std::nullopt;
}

/// Expected photons of the object in one capture.
double photons_of(const Scene& scene, const DrawnObject& object, const Exposure& exposure) {
  return exposure.exposures * object.amplitude * total_counts(scene, object.three_bounce);
}

void summarise(const Scene& scene, CoverageLevel& level) {
  level.claims = claims_of(level.trials, static_cast<int>(scene.unknowns.size()));
  level.failures = failures_of(level.trials);
  level.warnings = warnings_of(level.trials);
  level.median_error = median(values_of(level.trials, &ClaimTrial::distance));
  level.median_photons = median(values_of(level.trials, &ClaimTrial::photons));
  level.median_claimed = median(values_of(level.trials, &ClaimTrial::claimed));
  const std::vector<double> squares = values_of(level.trials, &ClaimTrial::normalised_square);
  if (squares.size() < 2) return;
  const MeanInterval interval = mean_interval(squares);
  const auto unknowns = static_cast<double>(scene.unknowns.size());
  level.mean_square_low = interval.low / unknowns;
  level.mean_square_high = interval.high / unknowns;
}

/// Fitter for captures without noise.
Fitter without_samples(const Scene& scene, FitOptions options) {
  options.importance_samples = options.empty_captures = 0;
  return Fitter(scene, options);
}

/// `explains` fits captures without noise.
void study_wrong(const Scene& scene, const CoverageOptions& options, const Fitter& fitter,
                 const Fitter& explains, const std::vector<std::vector<DrawnObject>>& wrong_objects,
                 const std::function<void()>& advance, CoverageLevel& level) {
  const std::vector<WrongAssumption> assumptions = wrong_assumptions(scene);
  const auto count =
      std::min(level.trials.size(), static_cast<std::size_t>(options.wrong_captures));
  const std::span<const ClaimTrial> right(level.trials.data(), count);
  for (std::size_t a = 0; a < assumptions.size(); ++a) {
    auto trials = claim_trials(fitter, wrong_objects[a], level.exposure, level.seed, advance);
    run_trials(trials.size(), {}, [&](std::size_t i) {
      if (!trials[i].error.empty()) return;
      trials[i].unexplained_distance =
          unexplained_distance(explains, wrong_objects[a][i], level.exposure);
    });
    level.wrong.push_back(
        wrong_figures(assumptions[a], trials, right.subspan(0, std::min(count, trials.size()))));
  }
}

/// The first objects in light of half the sampling; none if there is no such light.
std::vector<DrawnObject> coarser_objects(const Scene& scene, const CoverageOptions& options) {
  DrawOptions draw = draw_options(options);
  draw.objects = std::min(draw.objects, kTruthChecks);
  draw.sampling *= 0.5;
  if (draw.light != TrueLight::reference || draw.sampling < DrawOptions::kMinSampling) return {};
  return draw_objects(scene, draw);
}

double truth_error(const Fitter& fitter, std::span<const DrawnObject> objects,
                   std::span<const DrawnObject> coarser, const Exposure& exposure) {
  const Scene& scene = fitter.scene();
  std::vector<double> squares(coarser.size());
  run_trials(coarser.size(), {}, [&](std::size_t i) {
    const PoseMixture fine = fitter.fit(expected_capture_of(scene, objects[i], exposure)).posterior;
    const PoseMixture coarse =
        fitter.fit(expected_capture_of(scene, coarser[i], exposure)).posterior;
    const PoseVector d = pose_error(scene, coarse.mean, fine.mean);
    squares[i] = d.dot(fine.covariance.ldlt().solve(d)) / static_cast<double>(d.size());
  });
  return std::accumulate(squares.begin(), squares.end(), 0.0) / static_cast<double>(squares.size());
}

/// The sampling that CoverageOptions::dense_truth asks for. Each sampling is judged by what changes
/// in the step to it from a coarser one.
double dense_sampling(const Scene& scene, const CoverageOptions& options, const Fitter& explains,
                      const Exposure& brightest) {
  DrawOptions draw = draw_options(options);
  draw.objects = std::min(draw.objects, kDenseChecks);
  const auto sampling = [&](double part) {
    return std::max(options.sampling * part, DrawOptions::kMinSampling);
  };
  draw.sampling = sampling(kTruthSamplings.front() / kDenser);
  std::vector<DrawnObject> coarser = draw_objects(scene, draw);
  for (const double part : kTruthSamplings) {
    draw.sampling = sampling(part);
    if (part == kTruthSamplings.back()) break;
    std::vector<DrawnObject> objects = draw_objects(scene, draw);
    // Errors fall at least with the square of the cells' edges, and their squares with the fourth
    // power.
    const double own = truth_error(explains, objects, coarser, brightest) / std::pow(kDenser, 4);
    if (own < kMaxTruthError) break;
    coarser = std::move(objects);
  }
  return draw.sampling;
}

const Exposure& brightest(const std::vector<ClaimLevel>& levels) {
  return std::ranges::max_element(levels, {},
                                  [](const ClaimLevel& level) { return level.exposure.exposures; })
      ->exposure;
}

}  // namespace

void CoverageOptions::validate() const {
  ClaimStudyOptions::validate();
  if (captures < 2) throw Error("CoverageOptions.captures", "accepted: at least 2");
  if (wrong_captures < 0 || wrong_captures > captures) {
    throw Error("CoverageOptions.wrong_captures", "accepted: 0 to as many as there are captures");
  }
}

bool ClaimTrial::has(const std::string& flag) const {
  return std::ranges::find(flags, flag) != flags.end();
}

bool ClaimTrial::warned() const {
  return !error.empty() || std::ranges::any_of(flags, [](const auto& f) { return f != "sampled"; });
}

ClaimTrial judge_fit(const Scene& scene, const FitResult& result, const PoseVector& truth,
                     std::uint64_t seed) {
  const PoseMixture& posterior = result.posterior;
  if (posterior.modes.empty() || !posterior.mean.allFinite() || !posterior.covariance.allFinite()) {
    throw Error("result", "found a value that is not finite");
  }
  ClaimTrial trial;
  const PoseVector d = pose_error(scene, posterior.mean, truth);
  trial.level = credible_level(scene, posterior, truth, 2000, seed);
  trial.normalised_square = d.dot(posterior.covariance.ldlt().solve(d));
  trial.distance = distance_of(d, unknown_names(scene));
  trial.claimed = std::sqrt(position_trace(scene, posterior.covariance));
  const std::optional<std::size_t> right = right_mode(scene, posterior, truth);
  for (std::size_t i = 0; i < posterior.modes.size(); ++i) {
    trial.modes.push_back({posterior.modes[i].weight, right == i});
  }
  trial.truth = truth;
  trial.mean = posterior.mean;
  trial.flags = result.flags;
  const GoodnessOfFit& fit = result.goodness_of_fit;
  if (fit.standard_deviation > 0) {
    trial.deviance_excess = (fit.deviance - fit.expected) / fit.standard_deviation;
  }
  if (!std::isfinite(trial.normalised_square + trial.claimed)) {
    throw Error("result", "found a covariance that is not positive definite");
  }
  return trial;
}

std::vector<ClaimTrial> claim_trials(const Fitter& fitter, std::span<const DrawnObject> objects,
                                     const Exposure& exposure, std::uint64_t seed,
                                     const std::function<void()>& advance) {
  return answered_trials(objects.size(), advance, [&](std::size_t i) {
    const std::uint64_t own = seed + kTrialSeed * (i + 1);
    const FitResult result = fitter.fit(capture_of(fitter.scene(), objects[i], exposure, own));
    ClaimTrial trial = judge_fit(fitter.scene(), result, objects[i].pose, own);
    trial.photons = photons_of(fitter.scene(), objects[i], exposure);
    return trial;
  });
}

double unexplained_distance(const Fitter& fitter, const DrawnObject& object,
                            const Exposure& exposure) {
  const FitResult fit = fitter.fit(expected_capture_of(fitter.scene(), object, exposure));
  return std::sqrt(std::max(fit.goodness_of_fit.deviance, 0.0));
}

double power_of_best_test(double distance) {
  const boost::math::normal normal;
  return boost::math::cdf(normal, distance - boost::math::quantile(normal, 1 - kBestTestAlarms));
}

std::vector<ClaimTest> claims_of(std::span<const ClaimTrial> trials, int unknowns) {
  std::vector<ClaimTest> claims;
  const auto count = static_cast<int>(trials.size());
  for (const double region : kRegions) {
    claims.push_back({percent("truth in the %.0f %% region", region), ClaimKind::share, region,
                      share_where(trials, [&](const ClaimTrial& t) { return held(t, region); }),
                      count});
  }
  double squares = 0;
  int answers = 0;
  for (const ClaimTrial& t : trials) {
    if (!t.error.empty()) continue;
    squares += t.normalised_square;
    ++answers;
  }
  const int degrees = answers * unknowns;
  claims.push_back({"mean squared normalised error", ClaimKind::mean_square, 1,
                    degrees > 0 ? squares / degrees : 0, degrees});
  add_weight_claims(trials, claims);
  return claims;
}

WarningShares warnings_of(std::span<const ClaimTrial> trials) {
  const auto with = [&](const char* flag) {
    return share_where(trials, [&](const ClaimTrial& t) { return t.has(flag); });
  };
  WarningShares shares;
  shares.multimodal = with("multimodal");
  shares.undetermined = with("undetermined");
  shares.misfit = with("model_misfit");
  shares.unexplained = with("unexplained_light");
  shares.at_bound = with("at_bound");
  shares.warned = share_where(trials, [](const ClaimTrial& t) { return t.warned(); });
  shares.unwarned = share_where(
      trials, [](const ClaimTrial& t) { return !held(t, kWarnedRegion) && !t.warned(); });
  return shares;
}

WrongFigures wrong_figures(const WrongAssumption& assumption, std::span<const ClaimTrial> wrong,
                           std::span<const ClaimTrial> right) {
  WrongFigures figures;
  figures.assumption = assumption;
  if (wrong.empty()) return figures;
  figures.captures = static_cast<int>(wrong.size());
  std::vector<double> growth;
  for (std::size_t i = 0; i < wrong.size(); ++i) {
    figures.failures += wrong[i].error.empty() ? 0 : 1;
    for (std::size_t r = 0; r < std::size(kRegions); ++r) {
      figures.held[r] += held(wrong[i], kRegions[r]) ? 1 : 0;
    }
    const bool outside = !held(wrong[i], kWarnedRegion);
    figures.unwarned += outside && !wrong[i].warned() ? 1 : 0;
    const double power =
        wrong[i].error.empty() ? power_of_best_test(wrong[i].unexplained_distance) : 1.0;
    figures.best_warned += power / figures.captures;
    figures.best_unwarned += outside ? (1 - power) / figures.captures : 0.0;
    const bool both = i < right.size() && wrong[i].error.empty() && right[i].error.empty();
    if (both && right[i].claimed > 0) growth.push_back(wrong[i].claimed / right[i].claimed);
  }
  figures.claimed_growth = median(growth);
  figures.median_error = median(values_of(wrong, &ClaimTrial::distance));
  figures.right_median_error = median(values_of(right, &ClaimTrial::distance));
  figures.warnings = warnings_of(wrong);
  const ShareInterval interval = exact_interval(figures.unwarned, figures.captures);
  figures.holds = interval.low <= 1 - kWarnedRegion;
  return figures;
}

CoverageScene study_coverage(const Scene& scene, const CoverageOptions& wanted,
                             const std::function<void()>& advance) {
  wanted.validate();
  CoverageOptions options = wanted;
  const std::vector<ClaimLevel> lights = light_levels(scene, options);
  const Fitter explains = without_samples(scene, options.fit);
  if (options.dense_truth && options.light == TrueLight::reference) {
    options.sampling = dense_sampling(scene, options, explains, brightest(lights));
  }
  DrawOptions draw = draw_options(options);
  const std::vector<DrawnObject> objects = draw_objects(scene, draw);
  std::vector<std::vector<DrawnObject>> wrong_objects;
  if (options.wrong_captures > 0) {
    draw.objects = options.wrong_captures;
    for (const WrongAssumption& assumption : wrong_assumptions(scene)) {
      draw.wrong = assumption.name;
      wrong_objects.push_back(assumption.left_out.empty() ? draw_objects(scene, draw)
                                                          : std::vector<DrawnObject>{});
    }
  }
  const std::vector<DrawnObject> coarser = coarser_objects(scene, options);
  CoverageScene study{scene, {}};
  add_levels(lights, study, [&](CoverageLevel& level) {
    level.sampling = options.sampling;
    const Fitter fitter(scene, options.fit);
    level.trials = claim_trials(fitter, objects, level.exposure, level.seed, advance);
    summarise(scene, level);
    level.example = ambiguous_example(fitter, objects, level.trials, level.exposure, level.seed);
    if (!coarser.empty()) {
      level.truth_error = truth_error(explains, objects, coarser, level.exposure);
    }
    if (options.wrong_captures > 0) {
      study_wrong(scene, options, fitter, explains, wrong_objects, advance, level);
    }
  });
  return study;
}

}  // namespace blindcorner
