// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/comparison.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <random>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/baseline/back_projection.h"
#include "blindcorner/inverse/baseline/multilateration.h"
#include "blindcorner/inverse/fit.h"
#include "forward/support/parallel.h"
#include "forward/support/quantile.h"

namespace blindcorner {
namespace {

constexpr int kDraws = 2000;
constexpr double kRegion = 0.95;

PoseVector truth_of(const std::vector<std::string>& names, const Capture& capture) {
  PoseVector truth(static_cast<Eigen::Index>(names.size()));
  for (std::size_t i = 0; i < names.size(); ++i) {
    truth[static_cast<Eigen::Index>(i)] = capture.truth.at(names[i]);
  }
  return truth;
}

MethodAnswer solver_answer(const Fitter& fitter, const Capture& capture, std::uint64_t seed) {
  const FitResult result = fitter.fit(capture);
  if (!result.posterior.mean.allFinite() || result.posterior.modes.empty()) {
    throw Error("solver", "the posterior is not finite");
  }
  return {result.posterior.mean, credible_level_of(fitter.scene(), result.posterior, capture, seed),
          result.flags};
}

MethodAnswer timed_answer(const ComparedMethod& method, const Capture& capture) {
  MethodAnswer answer;
  const auto start = std::chrono::steady_clock::now();
  try {
    // A thread that waits inside of a method must not take up another capture: its time would
    // count.
    tbb::this_task_arena::isolate([&] { answer = method.answer(capture); });
    if (!answer.pose.allFinite()) throw Error(method.name, "found an answer that is not finite");
  } catch (const std::exception& error) {
    answer = {};
    answer.error = error.what();
  }
  answer.time = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return answer;
}

/// Distance over the unknown coordinates of position, m.
double distance(const Scene& scene, const PoseVector& error) {
  double squares = 0;
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    if (scene.unknowns[i].component > Component::z) continue;
    squares += std::pow(error[static_cast<Eigen::Index>(i)], 2);
  }
  return std::sqrt(squares);
}

/// Indices of the captures of each place.
std::vector<std::vector<std::size_t>> places_of(std::size_t count,
                                                const CaptureClusters& clusters) {
  std::map<std::size_t, std::vector<std::size_t>> by_number;
  for (std::size_t i = 0; i < count; ++i)
    by_number[clusters.empty() ? i : clusters[i]].push_back(i);
  std::vector<std::vector<std::size_t>> places;
  for (auto& [number, indices] : by_number) places.push_back(std::move(indices));
  return places;
}

/// A figure and its percentiles over places that are drawn again; `figure` takes indices of
/// captures.
template <class Figure>
BootstrapInterval bootstrap_captures(std::size_t count, std::uint64_t seed,
                                     const CaptureClusters& clusters, const Figure& figure) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  if (count == 0) return {none, none, none};
  const std::vector<std::vector<std::size_t>> places = places_of(count, clusters);
  std::vector<std::size_t> drawn(count);
  std::iota(drawn.begin(), drawn.end(), std::size_t{0});
  const double value = figure(drawn);
  if (!std::isfinite(value)) return {none, none, none};
  std::mt19937_64 random(seed);
  std::uniform_int_distribution<std::size_t> pick(0, places.size() - 1);
  std::vector<double> values;
  for (int d = 0; d < kDraws; ++d) {
    drawn.clear();
    for (std::size_t i = 0; i < places.size(); ++i) {
      const std::vector<std::size_t>& place = places[pick(random)];
      drawn.insert(drawn.end(), place.begin(), place.end());
    }
    const double again = figure(drawn);
    if (std::isfinite(again)) values.push_back(again);
  }
  return {value, quantile(values, 0.025), quantile(values, 0.975)};
}

/// The statistic of the finite values among these; NaN if there are none.
double statistic_at(std::span<const double> values, const std::vector<std::size_t>& indices,
                    const Statistic& statistic) {
  std::vector<double> finite;
  finite.reserve(indices.size());
  for (const std::size_t i : indices) {
    if (std::isfinite(values[i])) finite.push_back(values[i]);
  }
  return finite.empty() ? std::numeric_limits<double>::quiet_NaN() : statistic(std::move(finite));
}

double mean(const std::vector<double>& values) {
  return std::reduce(values.begin(), values.end()) / static_cast<double>(values.size());
}

double root_mean(const std::vector<double>& values) { return std::sqrt(mean(values)); }

double ninth_decile(std::vector<double> values) { return quantile(std::move(values), 0.9); }

/// Captures of the same true values are of the same place.
CaptureClusters clusters_of(const std::vector<PoseVector>& truths) {
  CaptureClusters clusters;
  std::map<std::vector<double>, std::size_t> numbers;
  for (const PoseVector& truth : truths) {
    const std::vector<double> key(truth.begin(), truth.end());
    clusters.push_back(numbers.try_emplace(key, numbers.size()).first->second);
  }
  return clusters;
}

/// Number of unknown coordinates of position.
int coordinates(const Scene& scene) {
  return static_cast<int>(std::ranges::count_if(
      scene.unknowns, [](const Unknown& u) { return u.component <= Component::z; }));
}

double share_with(const std::vector<MethodAnswer>& answers, const char* flag) {
  double with = 0, count = 0;
  for (const MethodAnswer& a : answers) {
    if (!a.error.empty()) continue;
    with += std::ranges::find(a.flags, flag) != a.flags.end() ? 1 : 0;
    ++count;
  }
  return count > 0 ? with / count : 0;
}

/// Errors of the answers of one method; NaN if there is no answer.
struct AnswerErrors {
  std::vector<std::vector<double>> absolute;  ///< [unknowns][captures] m, rad or 1
  std::vector<double> lengths;                ///< [captures] of position, m
};

AnswerErrors answer_errors(const Scene& scene, const std::vector<PoseVector>& truths,
                           const std::vector<MethodAnswer>& answers) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  AnswerErrors errors{std::vector<std::vector<double>>(scene.unknowns.size()), {}};
  for (std::size_t i = 0; i < answers.size(); ++i) {
    const bool answered = answers[i].error.empty();
    const PoseVector error =
        answered ? pose_error(scene, answers[i].pose, truths[i]) : PoseVector();
    errors.lengths.push_back(answered ? distance(scene, error) : none);
    for (std::size_t k = 0; k < scene.unknowns.size(); ++k) {
      errors.absolute[k].push_back(answered ? std::abs(error[static_cast<Eigen::Index>(k)]) : none);
    }
  }
  return errors;
}

/// Index of the yaw among the unknowns.
std::optional<std::size_t> yaw_of(const Scene& scene) {
  for (std::size_t k = 0; k < scene.unknowns.size(); ++k) {
    if (scene.unknowns[k].component == Component::yaw) return k;
  }
  return std::nullopt;
}

std::optional<ClaimFigures> claims_of(const std::vector<MethodAnswer>& answers) {
  ClaimFigures claim;
  for (const MethodAnswer& answer : answers) {
    if (!answer.error.empty() || !answer.credible_level) continue;
    ++claim.claims;
    claim.held += *answer.credible_level <= kRegion ? 1 : 0;
  }
  if (claim.claims == 0) return std::nullopt;
  claim.share = static_cast<double>(claim.held) / claim.claims;
  claim.interval = wilson_interval(claim.held, claim.claims);
  return claim;
}

MethodFigures figures_of(const Scene& scene, const std::vector<MethodAnswer>& answers,
                         const AnswerErrors& errors, const CaptureClusters& clusters,
                         std::uint64_t seed) {
  MethodFigures figures;
  std::vector<double> times;    // NaN where there is no answer, as below
  std::vector<double> squares;  // mean over the coordinates
  for (std::size_t i = 0; i < answers.size(); ++i) {
    const bool answered = answers[i].error.empty();
    if (!answered && figures.failures++ == 0) figures.first_error = answers[i].error;
    times.push_back(answered ? answers[i].time : std::numeric_limits<double>::quiet_NaN());
    squares.push_back(errors.lengths[i] * errors.lengths[i] / coordinates(scene));
  }
  figures.answers = static_cast<int>(answers.size()) - figures.failures;
  for (const std::vector<double>& absolute : errors.absolute) {
    figures.mean_absolute.push_back(bootstrap(absolute, mean, seed, clusters));
  }
  figures.position = bootstrap(errors.lengths, median, seed, clusters);
  figures.p90 = bootstrap(errors.lengths, ninth_decile, seed, clusters);
  figures.rmse = bootstrap(squares, root_mean, seed, clusters);
  figures.time = bootstrap(times, median, seed, clusters);
  figures.claim = claims_of(answers);
  figures.misfit = share_with(answers, "model_misfit");
  figures.multimodal = share_with(answers, "multimodal");
  figures.at_bound = share_with(answers, "at_bound");
  return figures;
}

std::string text(const char* pattern, double a, double b = 0, double c = 0) {
  char line[160];
  std::snprintf(line, sizeof line, pattern, a, b, c);
  return line;
}

/// Why the first method may be worse, as far as the figures tell.
std::string reason(const Condition& condition, const MethodFigures& first) {
  std::string why = condition.wrong.empty()
                        ? "What the scene says is right here"
                        : "What the model assumes is wrong here: " + condition.wrong;
  why += text(
      ". The solver found a misfit in %.0f %% of these captures, several explanations in "
      "%.0f %% and an optimum at the end of a range in %.0f %%",
      100 * first.misfit, 100 * first.multimodal, 100 * first.at_bound);
  if (first.claim) {
    why += text("; its 95 %% regions held the truth in %.0f %%", 100 * first.claim->share);
    if (condition.wrong.empty() && first.claim->interval.high >= kRegion) {
      why += ", so that it does not claim more than it knows";
    }
  }
  return why + ".";
}

/// `what`: "median error"; `unit`: "m".
std::string finding(const Condition& condition, const std::string& what, const char* unit,
                    const std::string& better, const BootstrapInterval& of_better,
                    const MethodFigures& first, const BootstrapInterval& of_first,
                    const BootstrapInterval& difference) {
  const auto with_unit = [unit](double value) { return text("%.4f ", value) + unit; };
  return "In \"" + condition.name + "\", " + better + " has a smaller " + what + " (" +
         with_unit(of_better.value) + ") than the " + first.method + " (" +
         with_unit(of_first.value) + "); the difference is " + with_unit(difference.value) +
         text(" (95 %% from %.4f to ", difference.low) + with_unit(difference.high) + "). " +
         reason(condition, first);
}

/// Adds findings if a method is better than the first one beyond what the captures leave open.
void add_findings(const Condition& condition, const MethodFigures& figures,
                  const MethodFigures& first, std::optional<std::size_t> yaw,
                  std::vector<std::string>& findings) {
  const auto& position = figures.against_first;
  if (position && position->high < 0) {
    findings.push_back(finding(condition, "median error", "m", figures.method, figures.position,
                               first, first.position, *position));
  }
  const auto& turn = figures.yaw_against_first;
  if (turn && turn->high < 0) {
    const auto degrees = [](const BootstrapInterval& i) {
      return BootstrapInterval{i.value / kDegree, i.low / kDegree, i.high / kDegree};
    };
    findings.push_back(finding(condition, "mean error of yaw", "degrees", figures.method,
                               degrees(figures.mean_absolute[*yaw]), first,
                               degrees(first.mean_absolute[*yaw]), degrees(*turn)));
  }
}

}  // namespace

double credible_level_of(const Scene& scene, const PoseMixture& posterior, const Capture& capture,
                         std::uint64_t seed) {
  return credible_level(scene, posterior, truth_of(unknown_names(scene), capture), 2000, seed);
}

ComparedMethod network_method(const Scene& scene, const CnnBaseline& cnn, std::string name,
                              std::string training, std::uint64_t seed) {
  const bool claims = cnn.description().network == CnnArchitecture::wide;
  const auto shared = std::make_shared<const Scene>(scene);
  return {std::move(name), std::move(training), [cnn, shared, claims, seed](const Capture& c) {
            const Transform T = c.T_world_sensor.value_or(shared->T_world_sensor);
            if (!claims) return MethodAnswer{cnn.predict(c, T)};
            const PoseMixture posterior = cnn.posterior(c, T);
            return MethodAnswer{posterior.mean, credible_level_of(*shared, posterior, c, seed)};
          }};
}

std::vector<ComparedMethod> untrained_methods(const Scene& scene, std::uint64_t seed,
                                              const FitOptions& fit) {
  const auto fitter = std::make_shared<const Fitter>(scene, fit);
  const auto paths = std::make_shared<const Multilateration>(scene);
  const auto voxels = std::make_shared<const BackProjection>(scene);
  const PoseVector middle = middle_of_prior(scene);
  const std::string none = "none";
  return {{"solver", none,
           [fitter, seed](const Capture& c) { return solver_answer(*fitter, c, seed); }},
          {"multilateration", none,
           [paths](const Capture& c) { return MethodAnswer{paths->predict(c)}; }},
          {"back-projection", none,
           [voxels](const Capture& c) { return MethodAnswer{voxels->predict(c)}; }},
          {"middle of the prior", none, [middle](const Capture&) { return MethodAnswer{middle}; }}};
}

std::vector<std::vector<MethodAnswer>> answer_all(const std::vector<ComparedMethod>& methods,
                                                  std::span<const Capture> captures,
                                                  const std::function<void()>& advance) {
  std::vector<std::vector<MethodAnswer>> answers;
  for (const ComparedMethod& method : methods) {
    answers.emplace_back(captures.size());
    std::vector<MethodAnswer>& own = answers.back();
    parallel_for(std::size_t{0}, captures.size(), [&](std::size_t i) {
      own[i] = timed_answer(method, captures[i]);
      if (advance) advance();
    });
  }
  return answers;
}

BootstrapInterval bootstrap(std::span<const double> values, const Statistic& statistic,
                            std::uint64_t seed, const CaptureClusters& clusters) {
  return bootstrap_captures(values.size(), seed, clusters,
                            [&](const std::vector<std::size_t>& drawn) {
                              return statistic_at(values, drawn, statistic);
                            });
}

BootstrapInterval bootstrap_difference(std::span<const double> first,
                                       std::span<const double> second, const Statistic& statistic,
                                       std::uint64_t seed, const CaptureClusters& clusters) {
  if (first.size() != second.size()) {
    throw Error("bootstrap_difference", "found " + std::to_string(first.size()) + " and " +
                                            std::to_string(second.size()) +
                                            " values, accepted: as many of both");
  }
  std::vector<double> a(first.begin(), first.end()), b(second.begin(), second.end());
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!std::isfinite(a[i]) || !std::isfinite(b[i])) {
      a[i] = b[i] = std::numeric_limits<double>::quiet_NaN();
    }
  }
  return bootstrap_captures(a.size(), seed, clusters, [&](const std::vector<std::size_t>& drawn) {
    return statistic_at(a, drawn, statistic) - statistic_at(b, drawn, statistic);
  });
}

ConditionFigures compare(const Scene& scene, const Condition& condition,
                         const std::vector<ComparedMethod>& methods,
                         const std::vector<std::vector<MethodAnswer>>& answers,
                         std::uint64_t seed) {
  ConditionFigures result;
  result.condition = condition;
  result.condition.captures.clear();
  if (condition.captures.empty()) return result;
  const std::vector<std::string> names = unknown_names(scene);
  std::vector<PoseVector> truths;
  for (const Capture& capture : condition.captures) truths.push_back(truth_of(names, capture));
  const CaptureClusters clusters = clusters_of(truths);
  const std::optional<std::size_t> yaw = yaw_of(scene);
  AnswerErrors of_first;
  for (std::size_t m = 0; m < methods.size(); ++m) {
    AnswerErrors errors = answer_errors(scene, truths, answers[m]);
    MethodFigures figures = figures_of(scene, answers[m], errors, clusters, seed);
    figures.method = methods[m].name;
    if (m == 0) {
      of_first = std::move(errors);
    } else {
      figures.against_first =
          bootstrap_difference(errors.lengths, of_first.lengths, median, seed, clusters);
      if (yaw) {
        figures.yaw_against_first = bootstrap_difference(
            errors.absolute[*yaw], of_first.absolute[*yaw], mean, seed, clusters);
      }
      add_findings(condition, figures, result.methods.front(), yaw, result.findings);
    }
    result.methods.push_back(std::move(figures));
  }
  return result;
}

}  // namespace blindcorner
