// SPDX-License-Identifier: Apache-2.0
/// Compares several methods on the same captures: errors with intervals, claims, and which method
/// is better.
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

/// A method's answer to one capture.
struct MethodAnswer {
  PoseVector pose;
  /// The result of credible_level(), if the method claims a region.
  std::optional<double> credible_level{};
  std::vector<std::string> flags{};  ///< flags of a fit
  double time = 0;                   ///< s, wall clock
  std::string error{};               ///< why there is no answer; empty: there is one
};

struct ComparedMethod {
  std::string name;
  std::string training;  ///< what the method learnt from; "none"
  /// Answers one capture. May throw Error. Thread safe. The runner fills in time and error.
  std::function<MethodAnswer(const Capture&)> answer;
};

/// Credible level of a capture's truth in the method's own posterior: credible_level() with 2000
/// samples.
double credible_level_of(const Scene& scene, const PoseMixture& posterior, const Capture& capture,
                         std::uint64_t seed);

/// A network as a method with this name. A network that states a covariance claims a region.
ComparedMethod network_method(const Scene& scene, const CnnBaseline& cnn, std::string name,
                              std::string training, std::uint64_t seed);

/// The methods that need no training: the solver (posterior mean and 95 % region), multilateration,
/// back-projection and the middle of the prior. The solver comes first. All methods are told this
/// scene.
std::vector<ComparedMethod> untrained_methods(const Scene& scene, std::uint64_t seed,
                                              const FitOptions& fit = {});

/// Answers [methods][captures]. `advance` is called after each answer, from any thread. Except for
/// times, the answers are the same at any number of threads.
std::vector<std::vector<MethodAnswer>> answer_all(const std::vector<ComparedMethod>& methods,
                                                  std::span<const Capture> captures,
                                                  const std::function<void()>& advance = {});

/// A figure with its 95 % interval, from the percentiles of a bootstrap.
struct BootstrapInterval {
  double value = 0, low = 0, high = 0;
};

/// Numbers of the places that captures show, [captures]. Captures of the same place are drawn
/// together. Empty: each capture is drawn by itself.
using CaptureClusters = std::vector<std::size_t>;

/// A figure of at least one value: the median, for example.
using Statistic = std::function<double(std::vector<double>)>;

/// A statistic of the values. For its interval, the captures (or their places) are drawn again 2000
/// times. Values that are not finite are left out. The result is NaN if no value is left.
BootstrapInterval bootstrap(std::span<const double> values, const Statistic& statistic,
                            std::uint64_t seed, const CaptureClusters& clusters = {});

/// The statistic of the first values minus that of the second, for the same captures. Each draw
/// takes the same captures of both. Only captures with two finite values count.
BootstrapInterval bootstrap_difference(std::span<const double> first,
                                       std::span<const double> second, const Statistic& statistic,
                                       std::uint64_t seed, const CaptureClusters& clusters = {});

/// Share of captures whose truth lies in the claimed 95 % region.
struct ClaimFigures {
  int held = 0, claims = 0;
  double share = 0;
  ShareInterval interval;
};

/// Figures of one method under one condition. All intervals come from the bootstrap, except that of
/// the claim.
struct MethodFigures {
  std::string method;
  int answers = 0, failures = 0;
  std::vector<BootstrapInterval> mean_absolute;  ///< [unknowns] m, rad or 1; yaw: modulo symmetry
  BootstrapInterval position;                    ///< m, median Euclidean distance
  BootstrapInterval p90;   ///< m, distance that 90 % of the answers stay within
  BootstrapInterval rmse;  ///< m, over the unknown coordinates of position
  std::optional<ClaimFigures> claim;
  BootstrapInterval time;  ///< s, median
  /// Median distance minus the first method's, and mean absolute error of yaw (where yaw is
  /// unknown) minus the first method's, over the captures that both methods answered. Empty for the
  /// first method.
  std::optional<BootstrapInterval> against_first, yaw_against_first;
  /// Shares of the answers that carry the solver's flags model_misfit, multimodal and at_bound.
  double misfit = 0, multimodal = 0, at_bound = 0;
  std::string first_error;  ///< error of the first failure
};

struct ConditionFigures {
  Condition condition;  ///< the condition without its captures
  std::vector<MethodFigures> methods;
  /// Sentences about other methods with a smaller median distance or mean error of yaw than the
  /// first method, if the interval of the difference is below zero. The sentences say why, as far
  /// as the figures tell.
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
