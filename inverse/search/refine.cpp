// SPDX-License-Identifier: Apache-2.0
#include "inverse/search/refine.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "forward/support/parallel.h"
#include "inverse/likelihood/light_slope.h"
#include "inverse/posterior/fisher_information.h"
#include "inverse/posterior/mode_merging.h"
#include "inverse/posterior/prior_moments.h"

namespace blindcorner {
namespace {

/// When a descent stops. Tolerances are relative decreases of half the deviance, which is of the
/// order of the number of bins (1e3). In log likelihood they are 0.1 to get near an optimum, 1e-2
/// to tell basins apart and 1e-3 at the end. The numbers of iterations limit the time, by
/// judgement: more where iterations are cheap.
struct Stop {
  int iterations;
  double function_tolerance;
  bool central = false;  ///< central differences; forward ones are good enough to find a basin
};
constexpr Stop kApproach{8, 1e-4};
constexpr Stop kApproachCheap{40, 1e-5};
constexpr Stop kSettle{12, 1e-6};
constexpr Stop kPolish{25, 1e-6, true};
/// Most corrections of the spline by the model in a row. One correction leaves of a move the share
/// by which the spline's derivatives are off; two leave the square of that share. A gain in log
/// posterior of kWorthCorrecting, from a move of a tenth of a standard deviation, calls for another
/// correction.
constexpr int kMaxCorrections = 2;
constexpr double kWorthCorrecting = 0.005;
/// Gain in log posterior from a move of a fifth of a standard deviation. A descent ends with a step
/// that promises less.
constexpr double kSmallGain = 0.02;
/// Gain from a move of half a standard deviation. If a step by a model's forward differences
/// promised less than this and failed, the cause is the roughness of the light, and shorter steps
/// are not tried.
constexpr double kRough = 0.1;
/// Gain from a move of two standard deviations. Over such a move, the difference between the rough
/// models and better ones may change, and it is computed anew. It is computed at most kMaxMoves
/// times, by judgement, to limit the time.
constexpr double kLargeGain = 2;
constexpr int kMaxMoves = 3;
/// If a descent on the closed form gains at least this, its correction is computed anew. It is the
/// gain of a move of half a standard deviation, of which a part is lacking where the slopes are
/// off.
constexpr double kWorthAnotherMove = 0.1;
/// Optima this far below the best one, in log posterior, are not settled: the first descent has
/// left them within 0.1 of their peaks, and that is near enough.
constexpr double kWorthSettling = 2;
/// An optimum is on the slopes of a better one's peak if it lies within kOnSlope standard
/// deviations of it and no more than kAboveSlope, in log posterior, above the parabola about it. A
/// descent has ended early there, and another would end at that peak. kAboveSlope is what a
/// Gaussian falls by within one standard deviation. kOnSlope is, by judgement, as far as the
/// parabola may be trusted: there it has fallen by 8.
constexpr double kAboveSlope = 0.5;
constexpr double kOnSlope = 4;

/// Tolerated error of the log posterior from eliminating the linear unknowns. The residuals are
/// then right to sqrt(2 * kAccuracy) = 1.4e-5, and the Jacobian's gradient is that of eliminated
/// unknowns.
constexpr double kAccuracy = 1e-10;

/// An unknown is at a bound if its distance from the bound is below this share of its range. The
/// share is far above the rounding of 1e-16 and far below any uncertainty.
constexpr double kAtBound = 1e-9;

/// Residuals of a pose, with the linear unknowns eliminated. The light is differentiated
/// numerically.
class ResidualCost final : public ceres::CostFunction {
 public:
  ResidualCost(const PoseObjective& objective, const LightSource& light, bool central,
               LinearSolution& linear, int& evaluations)
      : objective_(objective),
        light_(light),
        central_(central),
        linear_(linear),
        evaluations_(evaluations) {
    const auto& unknowns = objective.compiled().scene.unknowns;
    priors_ = static_cast<int>(std::count_if(unknowns.begin(), unknowns.end(),
                                             [](const Unknown& u) { return u.prior.has_value(); }));
    set_num_residuals(objective.solver().residual_count() + priors_);
    mutable_parameter_block_sizes()->push_back(objective.compiled().unknown_count());
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const int n = objective_.compiled().unknown_count();
    const PoseVector pose = Eigen::Map<const PoseVector>(parameters[0], n);
    // Ceres asks for the Jacobian at a pose whose residuals it has asked for before.
    if (pose_.size() != n || pose_ != pose) {
      compute(pose);
      pose_ = pose;
    }
    std::ranges::copy(residuals_, residuals);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      light_slope(objective_, light_, pose, here_,
                  central_ ? Differences::central : Differences::one_sided, slope_);
      slope_pose_ = pose;
      differentiate(residuals, jacobians[0]);
    }
    return true;
  }

  /// The light's slopes at `pose` if the last ones were taken there, else empty.
  Eigen::MatrixXd slope_at(const PoseVector& pose) const {
    return slope_pose_.size() == pose.size() && slope_pose_ == pose ? slope_ : Eigen::MatrixXd();
  }

 private:
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  void compute(const PoseVector& pose) const {
    ++evaluations_;
    residuals_.resize(static_cast<std::size_t>(num_residuals()));
    double* residuals = residuals_.data();
    objective_.shapes(light_, pose, here_);
    objective_.solver().eliminate(here_.shapes, linear_, !linear_.ambient.empty(), kAccuracy);
    objective_.solver().residuals(here_.shapes, linear_, residuals);
    double* out = residuals + objective_.solver().residual_count();
    const auto& unknowns = objective_.compiled().scene.unknowns;
    for (std::size_t i = 0; i < unknowns.size(); ++i) {
      if (!unknowns[i].prior) continue;
      *out++ =
          (pose[static_cast<Eigen::Index>(i)] - unknowns[i].prior->mean) / unknowns[i].prior->sigma;
    }
  }

  void differentiate(const double* residuals, double* out) const {
    const auto& unknowns = objective_.compiled().scene.unknowns;
    const auto n = static_cast<Eigen::Index>(unknowns.size());
    objective_.solver().jacobian(here_.shapes, linear_, slope_, residuals, out);
    double* const first = out;
    out += objective_.solver().residual_count() * n;
    for (std::size_t i = 0; i < unknowns.size(); ++i) {
      if (!unknowns[i].prior) continue;
      std::fill(out, out + n, 0.0);
      out[i] = 1 / unknowns[i].prior->sigma;
      out += n;
    }
    hold_at_bounds(residuals, {first, num_residuals(), n});
  }

  /// Holds unknowns at their bounds if a descent would take them over these. Otherwise, the other
  /// unknowns' steps would rely on moves that the bounds do not allow.
  void hold_at_bounds(const double* residuals, Eigen::Map<RowMajor> jacobian) const {
    const Scene& scene = objective_.compiled().scene;
    const Eigen::Map<const Eigen::VectorXd> r(residuals, jacobian.rows());
    for (Eigen::Index i = 0; i < jacobian.cols(); ++i) {
      const int bound = bound_at(scene, pose_, i);
      if (bound != 0 && bound * jacobian.col(i).dot(r) < 0) jacobian.col(i).setZero();
    }
  }

  const PoseObjective& objective_;
  const LightSource& light_;
  const bool central_;
  LinearSolution& linear_;
  int& evaluations_;
  int priors_ = 0;
  mutable PoseVector pose_, slope_pose_;  // last computed
  mutable ShapeBuffer here_;
  mutable std::vector<double> residuals_;
  mutable Eigen::MatrixXd slope_;
};

/// Ends a descent at a step that promised next to nothing. Ceres would take more such steps and,
/// after one that fails, shorter and shorter ones. On a light that costs nothing, a descent ends
/// only at such a step that fails.
class NothingPromised final : public ceres::IterationCallback {
 public:
  explicit NothingPromised(bool dear) : dear_(dear) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& step) override {
    if (step.iteration == 0) return ceres::SOLVER_CONTINUE;
    const double promised =
        step.relative_decrease != 0 ? step.cost_change / step.relative_decrease : 0.0;
    const double least =
        step.step_is_successful ? (dear_ ? kSmallGain : 0.0) : (dear_ ? kRough : kSmallGain);
    return promised < least ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  bool dear_;
};

/// Diagonal of the search region, each unknown in its own unit.
double region_size(const Scene& scene) {
  double square = 0;
  for (const Unknown& unknown : scene.unknowns) square += std::pow(unknown.range(), 2);
  return std::max(std::sqrt(square), 1e-300);
}

/// Runs Ceres on one light. `result` holds the start and receives the end. The unknown `held` does
/// not move. `slope` receives the light's slopes at the end, or nothing if they are not known
/// there.
void minimise(const PoseObjective& objective, const LightSource& light, const Stop& stop,
              Refined& result, Eigen::MatrixXd* slope = nullptr,
              std::optional<int> held = std::nullopt) {
  const Scene& scene = objective.compiled().scene;
  ResidualCost cost(objective, light, stop.central, result.linear, result.evaluations);
  ceres::Problem::Options ownership;
  ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  double* x = result.pose.data();
  problem.AddResidualBlock(&cost, nullptr, x);
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    if (period_of(scene, i) > 0) continue;
    problem.SetParameterLowerBound(x, static_cast<int>(i), scene.unknowns[i].lower);
    problem.SetParameterUpperBound(x, static_cast<int>(i), scene.unknowns[i].upper);
  }
  if (held) {
    const auto size = static_cast<int>(result.pose.size());
    problem.SetManifold(x, new ceres::SubsetManifold(size, {*held}));  // problem owns it
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.max_num_iterations = stop.iterations;
  options.function_tolerance = stop.function_tolerance;
  // So small that the function's tolerance decides. It is relative to the search region and not to
  // the distance from the origin: 100 km from the origin, descents would end 1 cm early.
  options.parameter_tolerance = 1e-7 / std::max(1.0, result.pose.norm() / region_size(scene));
  options.gradient_tolerance = 1e-9;
  // A step over a bound ends at the bound, and the next step holds the unknown there. Neither needs
  // a line search.
  options.max_num_line_search_step_size_iterations = 0;
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;
  NothingPromised nothing_promised(light.models != nullptr && !stop.central);
  options.callbacks.push_back(&nothing_promised);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  result.converged = summary.IsSolutionUsable();
  if (slope != nullptr) *slope = cost.slope_at(result.pose);
}

Refined finish(const PoseObjective& objective, const LightSource& light, Refined result) {
  wrap_pose(objective.compiled().scene, result.pose);
  result.value = objective.evaluate(light, result.pose, result.linear, true);
  return result;
}

/// The light that decides near a pose: that of the objective's models or, where these are finer
/// than the rough models and cost more, that of the rough models, corrected at the pose.
class NearbyModel {
 public:
  /// `here` is the models' light at the pose, or null if it is not known.
  NearbyModel(const PoseObjective& objective, const PoseVector& pose, const ShapeBuffer* here)
      : light_(objective.models()) {
    if (here == nullptr) {
      objective.shapes(objective.models(), pose, own_);
      here = &own_;
    }
    here_ = here;
    if (&objective.models() == &objective.rough_models()) return;
    ShapeBuffer rough;
    objective.shapes(objective.rough_models(), pose, rough);
    correction_ = objective.correction(*here, rough);
    light_ = LightSource(objective.rough_models()).corrected(correction_);
  }
  NearbyModel(const NearbyModel&) = delete;
  NearbyModel& operator=(const NearbyModel&) = delete;

  const LightSource& light() const { return light_; }
  /// The models' light at the pose.
  const ShapeBuffer& here() const { return *here_; }

 private:
  ShapeBuffer own_;
  const ShapeBuffer* here_ = nullptr;
  Correction correction_;
  LightSource light_;
};

/// Adds the models' value at the pose, and what the cheaper light lacks there.
Refined finish_corrected(const PoseObjective& objective, const LightSource& cheaper,
                         Refined result) {
  wrap_pose(objective.compiled().scene, result.pose);
  ShapeBuffer right;
  ShapeBuffer cheap;
  objective.shapes(objective.models(), result.pose, right);
  objective.shapes(cheaper, result.pose, cheap);
  result.correction = objective.correction(right, cheap);
  result.value =
      objective.evaluate(right, result.pose, result.linear, !result.linear.ambient.empty());
  ++result.evaluations;
  return result;
}

/// Descends on a cheap light that the model corrects at the end of the last descent. Repeats this
/// `most` times, or until a descent gains less than `worth`. Keeps the best place by the model's
/// value.
template <class Descend>
Refined descend_corrected(const PoseObjective& objective, const LightSource& cheap, int most,
                          double worth, Refined start, const Descend& descend) {
  Refined best = finish_corrected(objective, cheap, std::move(start));
  for (int k = 0; k < most; ++k) {
    Refined next = best;
    descend(cheap.corrected(best.correction), next);
    next = finish_corrected(objective, cheap, std::move(next));
    const double gain = next.value.log_posterior - best.value.log_posterior;
    if (gain > 0) best = std::move(next);
    if (gain < worth) break;
  }
  return best;
}

/// Least squares on the model with the spline's derivatives: minimises on the spline, corrected by
/// the model at the last pose, until that gains no more. At the end, J'r = 0 holds with the
/// spline's Jacobian instead of the model's. If their columns differ by a share e, the log
/// posterior lacks e^2 / 2 for each unknown there, times the misfit (chi squared per degree of
/// freedom).
Refined polish_on_spline(const PoseObjective& objective, Refined start) {
  return descend_corrected(
      objective, *objective.compiled().spline, kMaxCorrections, kWorthCorrecting, std::move(start),
      [&](const LightSource& light, Refined& next) { minimise(objective, light, kSettle, next); });
}

}  // namespace

int bound_at(const Scene& scene, const PoseVector& pose, Eigen::Index unknown) {
  const auto k = static_cast<std::size_t>(unknown);
  if (period_of(scene, k) > 0) return 0;
  const Unknown& of = scene.unknowns[k];
  const double margin = kAtBound * of.range();
  if (pose[unknown] <= of.lower + margin) return -1;
  return pose[unknown] >= of.upper - margin ? 1 : 0;
}

LightSource light_near(const PoseObjective& objective, const Refined& refined) {
  if (refined.correction.empty()) return objective.models();
  const CompiledScene& compiled = objective.compiled();
  const LightSource cheaper =
      compiled.spline ? LightSource(*compiled.spline) : LightSource(objective.rough_models());
  return cheaper.corrected(refined.correction);
}

Refined approach(const PoseObjective& objective, const Start& start) {
  const CompiledScene& compiled = objective.compiled();
  Refined result;
  result.pose = start.pose;
  const auto descend = [&](const LightSource& light, const Stop& stop, Refined& from) {
    if (start.held_first) minimise(objective, light, stop, from, nullptr, start.held_first);
    minimise(objective, light, stop, from);
  };
  if (compiled.spline) {
    descend(*compiled.spline, kApproachCheap, result);
    return finish(objective, *compiled.spline, std::move(result));
  }
  if (!compiled.coarse.empty()) {
    if (!compiled.pairs_lobes()) {
      descend(objective.models(), kApproach, result);
      return finish(objective, objective.models(), std::move(result));
    }
    Refined best = descend_corrected(
        objective, LightSource(compiled.coarse), kMaxMoves, kWorthAnotherMove, std::move(result),
        [&](const LightSource& light, Refined& next) { descend(light, kApproachCheap, next); });
    best.correction = {};  // of a light that nobody else uses
    return best;
  }
  for (std::size_t rung = 0; rung + 1 < compiled.ladder.size(); ++rung) {
    descend(compiled.ladder[rung], kApproach, result);
  }
  return finish(objective, compiled.cheap_models(), std::move(result));
}

std::vector<Refined> approach_all(const PoseObjective& objective,
                                  const std::vector<Start>& starts) {
  std::vector<Refined> reached(starts.size());
  parallel_for(std::size_t{0}, starts.size(),
               [&](std::size_t i) { reached[i] = approach(objective, starts[i]); });
  return reached;
}

Refined polish(const PoseObjective& objective, const PoseVector& start) {
  const CompiledScene& compiled = objective.compiled();
  Refined result;
  result.pose = start;
  if (compiled.spline) return polish_on_spline(objective, std::move(result));
  if (!compiled.coarse.empty()) return approach(objective, {start});  // settled later
  minimise(objective, objective.models(), kPolish, result);
  return finish(objective, objective.models(), std::move(result));
}

void settle(const PoseObjective& objective, Refined& optimum, const ShapeBuffer* here) {
  const CompiledScene& compiled = objective.compiled();
  if (compiled.coarse.empty()) {
    optimum = polish(objective, optimum.pose);
    return;
  }
  for (int k = 0; k < kMaxMoves; ++k) {
    const NearbyModel model(objective, optimum.pose, k == 0 ? here : nullptr);
    const double before =
        objective
            .evaluate(model.here(), optimum.pose, optimum.linear, !optimum.linear.ambient.empty())
            .log_posterior;
    minimise(objective, model.light(), kSettle, optimum, &optimum.slope);
    if (optimum.slope.size() == 0) {
      optimum.slope = light_slope(objective, model.light(), optimum.pose);
    }
    if (model.light().correction == nullptr) {
      optimum.correction = {};
      optimum = finish(objective, objective.models(), std::move(optimum));
      break;
    }
    optimum = finish_corrected(objective, objective.rough_models(), std::move(optimum));
    if (optimum.value.log_posterior < before + kLargeGain) break;
  }
}

std::vector<Refined> without_slopes(const PoseObjective& objective, std::vector<Refined> optima) {
  if (objective.compiled().coarse.empty() || optima.size() < 2) return optima;
  const Scene& scene = objective.compiled().scene;
  const Refined best = optima.front();
  const Eigen::MatrixXd precision = pose_information(objective, best).pose + prior_precision(scene);
  std::erase_if(optima, [&](const Refined& other) {
    const PoseVector way = pose_difference(scene, best.pose, other.pose);
    const double square = way.dot(precision * way);
    const double below = best.value.log_posterior - other.value.log_posterior;
    return square > 0 && square < kOnSlope * kOnSlope && below > 0.5 * square - kAboveSlope;
  });
  return optima;
}

std::vector<Refined> polish_all(const PoseObjective& objective,
                                const std::vector<PoseVector>& starts, double negligible,
                                std::vector<Refined> optima) {
  const std::size_t known = optima.size();
  optima.resize(known + starts.size());
  parallel_for(std::size_t{0}, starts.size(),
               [&](std::size_t i) { optima[known + i] = polish(objective, starts[i]); });
  optima = merge(objective.compiled(), std::move(optima), negligible);
  return without_slopes(objective, std::move(optima));
}

std::vector<Refined> settle_all(const PoseObjective& objective, std::vector<Refined> optima,
                                double negligible) {
  const CompiledScene& compiled = objective.compiled();
  if (compiled.coarse.empty() || optima.empty()) return optima;
  const double least = optima.front().value.log_posterior - kWorthSettling;
  parallel_for(std::size_t{0}, optima.size(), [&](std::size_t i) {
    if (optima[i].slope.size() == 0 && optima[i].value.log_posterior >= least) {
      settle(objective, optima[i]);
    }
  });
  return merge(compiled, std::move(optima), negligible);
}

std::vector<Refined> find_optima(const PoseObjective& objective,
                                 const std::vector<PoseVector>& starts, double negligible,
                                 std::vector<Refined> optima) {
  return settle_all(objective, polish_all(objective, starts, negligible, std::move(optima)),
                    negligible);
}

}  // namespace blindcorner
