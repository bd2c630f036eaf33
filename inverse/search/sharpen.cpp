// SPDX-License-Identifier: Apache-2.0
#include "inverse/search/sharpen.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "forward/support/parallel.h"
#include "inverse/likelihood/light_slope.h"
#include "inverse/posterior/fisher_information.h"
#include "inverse/posterior/goodness_of_fit.h"
#include "inverse/posterior/mode_merging.h"
#include "inverse/posterior/prior_moments.h"

namespace blindcorner {
namespace {

/// Optima this far below the best one, in log posterior, hold less than a per cent of the posterior
/// each. The models that found them are good enough for them.
constexpr double kWorthSharpening = 5;
/// The deviance of a right optimum hardly ever exceeds its expectation by this many standard
/// deviations of photon noise: one in 740 does.
constexpr double kNoNoise = 3;
/// A move of this part of a standard deviation is not worth a better model. Carried in the
/// covariance, it widens a standard deviation by 2 %.
constexpr double kSmallMove = 0.2;
/// The next level's move is taken to be at least this part of the last one, because moves fall less
/// than errors do (light of the oblique floor at a million photons: by a factor of 0.3 to 2, half
/// of them by less than 0.6).
constexpr double kLeft = 0.5;
/// Smaller changes of the log posterior at the optimum are not worth a better model. A model that
/// changes it there may change it by more elsewhere. A change by this much changes a mode's weight
/// by a third. By judgement.
constexpr double kSmallShift = 0.3;
/// The most paths (lit times seen times object points) of pairs of lobes that one render may sum
/// over. Such a render takes some 0.3 s, and a fit takes ten or more renders. In the street's
/// drives, a sensor close to the turn needs more than three times as many paths: a fit then takes
/// up to minutes, and 4 s without the finer model.
constexpr double kMostPaths = 1e10;
/// A model overstates the information about the pose if it claims this many times as much as a
/// finer model does, in some direction. A standard deviation is then stated a tenth too small. The
/// finer model takes over for that up to level Levels::most_jagged, by judgement of time: a
/// posterior's samples cost as much as their renders. On tmf8828_wall with eight times its light
/// (600 captures), the mean squared normalised error is 1.10 without this rule, 1.05 with a factor
/// of 1.5 and 1.04 with 1.25, for a tenth more time at most.
constexpr double kOverstated = 1.25;
/// Most times that the best optimum's shadow is computed anew. By judgement, to limit the time:
/// each time the shadow changes by a small part of its last change.
constexpr int kMaxShadows = 4;
/// Largest relative error (L2) of a shadow's light at the usual sampling (3 % on a desk, tests).
constexpr double kShadowError = 0.1;
/// Accuracy and limits of the levels for one kind of material.
struct Levels {
  /// Largest relative error (L2) of each level's light on the shipped scenes. The first level is
  /// CompiledScene::models().
  std::array<double, kModelLevels> errors;
  /// A move below this, in standard deviations, is carried in the covariance instead of being
  /// computed with the next level.
  double carried;
  int most_jagged;  ///< highest level that takes over because the one before overstates slopes
};
constexpr Levels kMatt{{0.06, 0.02, 0.007, 0.002}, kSmallMove, 2};
/// A better model of a lobe sums over pairs, and each level costs five to ten times as much as the
/// one before. The rough models' light is corrected at the optima. These then end a third of a
/// standard deviation from where the better model's own derivatives lead (street corner), in a
/// third of the time. The move that is carried widens a standard deviation by 8 % at most.
constexpr Levels kLobes{{0.1, 0.02, 0.005, 0.003}, 0.4, 0};

const Levels& levels_of(const Scene& scene) {
  const bool lobes = std::holds_alternative<RetroreflectiveMaterial>(scene.hidden.material);
  return lobes ? kLobes : kMatt;
}

/// Covariance of a move that is equally long in any direction. `square` is its squared length in
/// standard deviations.
Eigen::MatrixXd in_any_direction(double square, const Eigen::MatrixXd& precision) {
  return square / static_cast<double>(precision.rows()) * precision.inverse();
}

/// Moves the optima that may matter. `here` is the models' light at the first one.
void sharpen_each(const PoseObjective& objective, std::vector<Refined>& optima,
                  const ShapeBuffer& here) {
  const double best = optima.front().value.log_posterior;
  std::vector<double> rough;
  for (const Refined& optimum : optima) rough.push_back(optimum.value.log_posterior);
  const auto settle_those = [&](double least, double below) {
    parallel_for(std::size_t{0}, optima.size(), [&](std::size_t i) {
      if (rough[i] < least || rough[i] >= below) return;
      settle(objective, optima[i], i == 0 ? &here : nullptr);
    });
  };
  const double least = best - kWorthSharpening;
  constexpr double kAll = std::numeric_limits<double>::infinity();
  settle_those(least, kAll);
  // The better model may change another optimum as much as the best one. Where the best one still
  // lacks more than photon noise explains, any other may be the right one.
  const GoodnessOfFit fit = goodness_of_fit(objective, optima.front());
  const bool lacks = fit.deviance > fit.expected + kNoNoise * fit.standard_deviation;
  const double moved = std::abs(optima.front().value.log_posterior - best);
  settle_those(lacks ? -kAll : least - 2 * moved, least);
}

/// Where a change of the object's light [rows, 1] moves an optimum.
struct Move {
  Eigen::MatrixXd precision;  ///< of the pose there, the prior's included
  Eigen::VectorXd by;
  double square = 0;  ///< its length in standard deviations, squared

  Move(const PoseObjective& objective, const Refined& optimum, const Eigen::MatrixXd& change) {
    const PoseInformation info = pose_information(objective, optimum, change);
    precision = info.pose + prior_precision(objective.compiled().scene);
    by = precision.ldlt().solve(info.disturbance.col(0));
    square = by.dot(precision * by);
  }
};

/// Whether the information about the pose that is `claimed` exceeds that of the finer models by
/// kOverstated in some direction. Light that jumps from cell to cell along a shadow's edge has
/// steep slopes that are not real. `finer_light` is the finer models' light at the optimum.
bool overstated(const PoseObjective& objective, const Eigen::MatrixXd& claimed,
                const ModelSet& finer, const Refined& optimum, const ShapeBuffer& finer_light) {
  const Eigen::MatrixXd prior = prior_precision(objective.compiled().scene);
  Eigen::MatrixXd slope;
  light_slope(objective, LightSource(finer), optimum.pose, finer_light, Differences::one_sided,
              slope);
  const Eigen::MatrixXd right =
      pose_information(objective, finer_light, optimum.linear, slope).pose + prior;
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> ratio(claimed, right,
                                                                        Eigen::EigenvaluesOnly);
  return ratio.eigenvalues().maxCoeff() > kOverstated;
}

/// The change of the object's light at unit amplitude, [rows, 1], that changes the expected counts
/// as much as a change of the static background, [rows], does.
Eigen::MatrixXd as_object(const PoseObjective& objective, const Refined& optimum,
                          const std::vector<double>& background) {
  Eigen::MatrixXd change = Eigen::MatrixXd::Zero(objective.rows(), 1);
  Eigen::Index row = 0;
  const Observation& observation = objective.solver().observation();
  for (std::size_t z = 0; z < observation.zones.size(); ++z) {
    const double amplitude = optimum.linear.amplitude[z];
    const double scale = amplitude > 0 ? optimum.linear.direct[z] / amplitude : 0;
    for (int k = 0; k < observation.zones[z].bins(); ++k, ++row) {
      change(row, 0) = scale * background[static_cast<std::size_t>(row)];
    }
  }
  return change;
}

}  // namespace

double light_error(const Scene& scene, int level) {
  return levels_of(scene).errors.at(static_cast<std::size_t>(level));
}

std::string too_dear_hint() {
  return "A finer model of the light would take seconds a render from here and was left out: the "
         "stated uncertainty holds what it may change.";
}

ModelError sharpen(PoseObjective& objective, std::vector<Refined>& optima, double negligible) {
  const CompiledScene& compiled = objective.compiled();
  ModelError error;
  const auto n = static_cast<Eigen::Index>(compiled.unknown_count());
  error.covariance.setZero(n, n);
  if (compiled.knowledge->coarse() == nullptr) return error;  // measured laws are exact
  const Levels& levels = levels_of(compiled.scene);
  for (int level = 1; level < kModelLevels; ++level) {
    const double before = levels.errors[static_cast<std::size_t>(level) - 1];
    Refined top = optima.front();
    // Settled optima have slopes. Others get them from the rough models: closed form may see
    // nothing of an object that is almost hidden.
    if (top.slope.size() == 0) {
      top.slope = light_slope(objective, LightSource(objective.rough_models()), top.pose);
    }
    const PoseInformation known = pose_information(objective, top);
    // An error of the share `before` of the light moves nothing by more standard deviations than
    // this.
    if (before * std::sqrt(known.signal) < kSmallMove) break;
    const ModelSet* finer = compiled.models_within(level, kMostPaths);
    if (finer == nullptr) {
      const Eigen::MatrixXd precision = known.pose + prior_precision(compiled.scene);
      error.covariance += in_any_direction(before * before * known.signal, precision);
      error.too_dear = true;
      break;
    }
    ShapeBuffer now;
    ShapeBuffer then;
    objective.shapes(light_near(objective, top), top.pose, now);
    objective.shapes(*finer, top.pose, then);
    Eigen::MatrixXd change(objective.rows(), 1);
    for (Eigen::Index r = 0; r < change.rows(); ++r) {
      const auto k = static_cast<std::size_t>(r);
      change(r, 0) = then.object[k] - now.object[k];
    }
    const Move move(objective, top, change);
    error.covariance = move.by * move.by.transpose();
    LinearSolution linear = top.linear;
    const PoseValue value = objective.evaluate(then, top.pose, linear, true);
    // The misfit that the finer model has too, at the moved optimum, has other reasons than
    // sampling. It widens the posterior, and against a wider posterior the move counts for less.
    const double wider =
        inflation(goodness_of_fit(objective, top), -2 * value.log_likelihood - move.square);
    const double size = std::sqrt(move.square / wider);
    const double shift = std::abs(value.log_posterior - top.value.log_posterior) / wider;
    const bool small = size < kSmallMove && shift < kSmallShift;
    if (level <= levels.most_jagged && overstated(objective, move.precision, *finer, top, then)) {
      objective.use(*finer);
      objective.use_roughly(*finer);
      for (Refined& optimum : optima) optimum.correction = {};  // belongs to other rough models
      sharpen_each(objective, optima, then);
      optima = merge(compiled, std::move(optima), negligible);
      error.covariance *= kLeft * kLeft;
      error.level = level;
      // Further levels are only for errors that move the optimum.
      if (level == levels.most_jagged && small) break;
      continue;
    }
    if (small) break;
    const double left = std::max(levels.errors[static_cast<std::size_t>(level)] / before, kLeft);
    if (level + 1 == kModelLevels && left * std::sqrt(move.square) >= levels.carried) {
      // No model is left to say where the next move would lead.
      error.covariance += in_any_direction(move.square, move.precision);
    }
    objective.use(*finer);
    sharpen_each(objective, optima, then);
    optima = merge(compiled, std::move(optima), negligible);
    error.covariance *= left * left;
    error.level = level;
    // The move to expect from the next level is small enough, if that level's error acts alike.
    if (left * size < levels.carried) break;
  }
  return error;
}

Eigen::MatrixXd cast_shadow(PoseObjective& objective, std::vector<Refined>& optima,
                            double negligible) {
  const auto n = static_cast<Eigen::Index>(objective.compiled().unknown_count());
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(n, n);
  for (int round = 0; round < kMaxShadows; ++round) {
    const Refined top = optima.front();
    const std::vector<double> before = objective.shadow();
    std::vector<double> change = objective.shadow_at(top.pose, round == 0);
    if (change.empty()) break;
    for (std::size_t r = 0; r < change.size(); ++r) {
      change[r] = (before.empty() ? 0 : before[r]) - change[r];
    }
    const Move move(objective, top, as_object(objective, top, change));
    if (move.square < kSmallMove * kSmallMove) break;
    if (round == 0) covariance = kShadowError * kShadowError * move.by * move.by.transpose();
    std::vector<double> shadow;  // of the best one
    double best = -std::numeric_limits<double>::infinity();
    for (Refined& optimum : optima) {
      objective.cast(objective.shadow_at(optimum.pose, false));
      optimum.value =
          objective.evaluate(light_near(objective, optimum), optimum.pose, optimum.linear, true);
      if (!(optimum.value.log_posterior > best)) continue;
      best = optimum.value.log_posterior;
      shadow = objective.shadow();
    }
    objective.cast(std::move(shadow));
    std::ranges::stable_sort(optima, std::greater{},
                             [](const Refined& o) { return o.value.log_posterior; });
    ShapeBuffer here;
    objective.shapes(objective.models(), optima.front().pose, here);
    sharpen_each(objective, optima, here);
    optima = merge(objective.compiled(), std::move(optima), negligible);
  }
  return covariance;
}

}  // namespace blindcorner
