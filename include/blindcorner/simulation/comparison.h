// SPDX-License-Identifier: Apache-2.0
/// Several methods on the same captures: errors with intervals, claims, and who is better.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "blindcorner/inverse/baseline/cnn.h"
#include "blindcorner/inverse/fit.h"
#include "blindcorner/simulation/comparison_conditions.h"
#include "blindcorner/simulation/credible_level.h"

namespace blindcorner {

/// What a method says of one capture.
struct MethodAnswer {
  PoseVector pose;
  /// As credible_level says, where the method claims a region.
  std::optional<double> credible_level{};
  std::vector<std::string> flags{};  ///< of a fit
  double time = 0;                   ///< s, wall clock
  std::string error{};               ///< why there is no answer; empty: there is
};

struct ComparedMethod {
  std::string name;
  std::string training;  ///< what it learnt from; "none"
  /// Answers one capture; may throw Error. Thread safe. Time and error are filled in by the runner.
  std::function<MethodAnswer(const Capture&)> answer;
};

/// How likely the method's own posterior finds what is true, by 2000 samples.
double credible_level_of(const Scene& scene, const PoseMixture& posterior, const Capture& capture,
                         std::uint64_t seed);

/// A network as a method, under a name. What states a covariance claims a region.
ComparedMethod network_method(const Scene& scene, const CnnBaseline& cnn, std::string name,
                              std::string training, std::uint64_t seed);

/// The solver (posterior mean and 95 % region), multilateration, back-projection and the middle of
/// the prior: what needs no training. The solver comes first. All are told this scene.
std::vector<ComparedMethod> untrained_methods(const Scene& scene, std::uint64_t seed,
                                              const FitOptions& fit = {});

/// Answers [methods][captures]. `advance` is called after each, from any thread. Times excepted,
/// the same at any number of threads.
std::vector<std::vector<MethodAnswer>> answer_all(const std::vector<ComparedMethod>& methods,
                                                  std::span<const Capture> captures,
                                                  const std::function<void()>& advance = {});

/// A figure with the interval that holds it with 95 %, by the bootstrap's percentiles.
struct BootstrapInterval {
  double value = 0, low = 0, high = 0;
};

/// Captures that are drawn together, because they show the same place: [captures] numbers of their
/// places. Empty: each by itself.
using CaptureClusters = std::vector<std::size_t>;

/// A figure of some values, at least one: their median, for example.
using Statistic = std::function<double(std::vector<double>)>;

/// A statistic of values, captures drawn again 2000 times. Values that are not finite are left out;
/// NaN without others.
BootstrapInterval bootstrap(std::span<const double> values, const Statistic& statistic,
                            std::uint64_t seed, const CaptureClusters& clusters = {});

/// That of the first less that of the second, of the same captures: each draw takes both, and only
/// captures of which both are finite.
BootstrapInterval bootstrap_difference(std::span<const double> first,
                                       std::span<const double> second, const Statistic& statistic,
                                       std::uint64_t seed, const CaptureClusters& clusters = {});

/// Share of captures whose truth lies in the claimed 95 % region.
struct ClaimFigures {
  int held = 0, claims = 0;
  double share = 0;
  ShareInterval interval;
};

/// One method under one condition. Intervals are the bootstrap's, but for that of the claim.
struct MethodFigures {
  std::string method;
  int answers = 0, failures = 0;
  std::vector<BootstrapInterval> mean_absolute;  ///< [unknowns] m, rad or 1; yaw: its symmetry's
  BootstrapInterval position;                    ///< m, median Euclidean distance
  BootstrapInterval p90;                         ///< m, that 90 % stay within
  BootstrapInterval rmse;                        ///< m, over the unknown coordinates of position
  std::optional<ClaimFigures> claim;
  BootstrapInterval time;  ///< s, median
  /// Median distance less the first method's, and mean absolute error of yaw (where it is unknown)
  /// less the first method's, over captures that both answered; empty for the first.
  std::optional<BootstrapInterval> against_first, yaw_against_first;
  /// Shares of the answers that carry the solver's words about itself.
  double misfit = 0, multimodal = 0, at_bound = 0;
  std::string first_error;  ///< of the failures
};

struct ConditionFigures {
  Condition condition;  ///< its captures left out
  std::vector<MethodFigures> methods;
  /// Sentences: where another method has a smaller median distance or mean error of yaw than the
  /// first, with the interval of the difference below zero, and why as far as the figures tell.
  std::vector<std::string> findings;
};

/// Figures of one condition from the answers [methods][captures].
ConditionFigures compare(const Scene& scene, const Condition& condition,
                         const std::vector<ComparedMethod>& methods,
                         const std::vector<std::vector<MethodAnswer>>& answers, std::uint64_t seed);

/// All conditions of one scene.
struct SceneComparison {
  std::string scene, file;
  std::vector<std::string> unknowns;
  std::vector<ComparedMethod> methods;
  std::vector<ConditionFigures> conditions;
};

}  // namespace blindcorner
