// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/fit.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <list>
#include <memory>
#include <mutex>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/validate.h"
#include "blindcorner/forward/transport/transport_plan.h"
#include "blindcorner/inverse/hints.h"
#include "inverse/likelihood/background_error.h"
#include "inverse/posterior/detection.h"
#include "inverse/posterior/fisher_information.h"
#include "inverse/posterior/fitted_histograms.h"
#include "inverse/posterior/goodness_of_fit.h"
#include "inverse/posterior/mode_merging.h"
#include "inverse/posterior/posterior.h"
#include "inverse/posterior/prior_moments.h"
#include "inverse/posterior/unexplained_light.h"
#include "inverse/search/climb.h"
#include "inverse/search/compiled_scene.h"
#include "inverse/search/refine.h"
#include "inverse/search/scoring.h"
#include "inverse/search/sharpen.h"
#include "inverse/tracking/capture_likelihood.h"

namespace blindcorner {
namespace {

/// How often sampling may send the fit back to refinement. By judgement: it bounds the time where
/// kWorthAnother does not end it.
constexpr int kMaxReturns = 3;
/// Gain in log posterior that changes the answer: a move of sqrt(2 * 0.01) = 0.14 standard
/// deviations, or a per cent of a mode's weight.
constexpr double kWorthAnother = 0.01;
/// Captures of one sensor placement for which tables of exact histograms pay: they cost seconds,
/// and save some ten milliseconds each.
constexpr int kManyCaptures = 50;
/// Starts that are followed at a time: more find out too late that others are better, fewer leave
/// cores idle. Four by judgement, whatever the machine, so that answers do not depend on it.
constexpr std::size_t kStartsAtOnce = 4;
/// Difference in log posterior between closed-form light and the model at an optimum, or between
/// what the optimum has and what a right one is expected to have, that shows closed form to be too
/// rough to choose starts with: nearly what places may be below the best one before they are
/// dropped (FitOptions::negligible_log_posterior), so that it may have dropped the right one.
constexpr double kTooRough = 10;
/// Presence is one half where the light says nothing, but for the rounding of evidence.
constexpr double kNoEvidence = 0.51;
/// So rough that descents on closed-form light, corrected by the model where they stand, do not get
/// to optima: the steps of the model's own cost four times as much. By judgement between kTooRough
/// and the thousand that it is off at 100,000 photons, where optima of a box and of two spheres
/// were missed in two captures of twelve each.
constexpr double kNoGuide = 100;
/// Standard deviations of photon noise that a right optimum hardly ever lacks: one in 740 does.
constexpr double kNoNoise = 3;
/// Times as rough as there that it may be elsewhere, and starts that the model chooses then. Both
/// by judgement: a larger factor has the model look at more places, each start costs it a descent.
constexpr double kRoughElsewhere = 1.5;
constexpr std::size_t kMorePlaces = 8;
/// Places that the model has not judged yet are kept down to so many times the fall that is
/// negligible. By judgement: it may still raise one against the best by half of that fall.
constexpr double kBeforeModel = 1.5;
/// Yaws from which the best optimum is looked for anew: 45 degrees apart where half a turn brings
/// an object back to itself. A box in the street at 3,000, 10,000 and 30,000 photons (60 captures
/// each): normalised error 1.16, 2.63, 3.19 without, 1.12, 1.02, 1.03 with them, for half as much
/// time again. Six yaws give no more. On a wall, where closed form leads well, 1000 captures of all
/// levels of light had a mean squared normalised error of 1.12, and 1.05 with them, for a tenth
/// more time.
constexpr int kYaws = 4;
/// Steps in which the rest of the pose follows the yaw, two standard deviations each at most. By
/// judgement; it ends before when a step gains nothing.
constexpr int kFollowing = 6;
/// A place this far below the best optimum in log posterior holds less than a per cent of the
/// posterior, gains of its own descent included.
constexpr double kWorthDescending = 6;
/// Optima farther than this from a place, in grid spacings along some unknown, are not its own:
/// they are nearer to another point of the grid.
constexpr double kElsewhere = 0.5;
/// Times that the best optimum is looked for anew: turned, or, of several objects, one's place
/// while the others stay; and places of each that are followed. Two spheres at 100,000 photons
/// needed one round and two places, a third of these.
constexpr int kMaxRounds = 3;
constexpr std::size_t kPlacesEach = 6;
/// Captures of a joint fit that search for the rest of them, where there are so many times more;
/// what they must gain over the empty scene in log posterior, misfit counted (a signal-to-noise
/// ratio of sqrt(2 * 100) = 14); and optima that may be left. The numbers of captures
/// and of optima by judgement: a search by so few costs half of one by all, or less.
constexpr std::size_t kFew = 4, kTimesFew = 2;
constexpr double kClear = 100;
constexpr std::size_t kFewOptima = 8;
/// Effective samples below which a flag says so: of 20, a variance is known to sqrt(2 / 20) = 32 %.
constexpr double kFewEffective = 20;
/// Finite-difference steps of the sensor's own pose, m and rad (a metre away as long): 4 mm of path
/// at most, for a pulse of 4 cm an error of (h / sigma)^2 / 6 = 0.2 %.
constexpr double kSensorStep = 2e-3;

/// Places that are about as good as the best optimum and have none near them: closed-form light,
/// corrected where a descent stands, has led away over what is a valley to the model.
std::vector<PoseVector> places_left(const CompiledScene& compiled,
                                    const std::vector<Refined>& basins,
                                    const std::vector<Refined>& optima) {
  std::vector<PoseVector> left;
  if (compiled.coarse.empty() || optima.empty()) return left;
  const double least = optima.front().value.log_posterior - kWorthDescending;
  for (const Refined& basin : basins) {
    const bool known = std::ranges::any_of(optima, [&](const Refined& optimum) {
      return within_spacings(compiled, optimum.pose, basin.pose, kElsewhere);
    });
    if (!known && basin.value.log_posterior >= least) left.push_back(basin.pose);
  }
  return left;
}

/// Moves places whose yaw is given to where closed-form light is best with that yaw, best first.
void follow_turns(const PoseObjective& objective, const Refined& optimum, Eigen::Index yaw,
                  std::vector<Climbed>& places) {
  const CompiledScene& compiled = objective.compiled();
  const Eigen::Index n = optimum.pose.size();
  const Eigen::MatrixXd precision =
      pose_information(objective, optimum).pose + prior_precision(compiled.scene);
  // One standard deviation each, given the yaw.
  std::vector<Eigen::Index> free;
  for (Eigen::Index r = 0; r < n; ++r) {
    if (r != yaw) free.push_back(r);
  }
  const Eigen::MatrixXd root = Eigen::MatrixXd(precision(free, free))
                                   .llt()
                                   .matrixU()
                                   .solve(Eigen::MatrixXd::Identity(n - 1, n - 1));
  Eigen::MatrixXd directions = Eigen::MatrixXd::Zero(n, n - 1);
  directions(free, Eigen::all) = root;
  const LightSource light(compiled.coarse);
  const LogTarget target = [&](const PoseVector& pose) {
    if (!std::isfinite(log_pose_prior(compiled.scene, pose))) {
      return -std::numeric_limits<double>::infinity();
    }
    LinearSolution linear = optimum.linear;
    return objective.evaluate(light, pose, linear, true).log_posterior;
  };
  tbb::this_task_arena::isolate([&] {
    tbb::parallel_for(std::size_t{0}, places.size(), [&](std::size_t j) {
      Climbed& place = places[j];
      place.target = target(place.pose);
      if (!std::isfinite(place.target)) return;
      Eigen::MatrixXd inverse = Eigen::MatrixXd::Identity(n - 1, n - 1);
      place = climb(std::move(place), directions, target, kFollowing, inverse);
    });
  });
  std::ranges::stable_sort(places, std::greater{}, &Climbed::target);
}

/// The best optimum, turned: other yaws, between which the range of yaws or the circle is divided,
/// best first by closed-form light after everything but the yaw has followed; without those that
/// are worse by more than `hopeless`. Turned where it stands, an object is worse whatever its yaw:
/// descents from there led a box in the street (10,000 photons) back in 2 of 120 captures, sure of
/// a yaw that is off by 64 degrees.
std::vector<PoseVector> turned(const PoseObjective& objective, const Refined& optimum,
                               double hopeless) {
  const CompiledScene& compiled = objective.compiled();
  const Scene& scene = compiled.scene;
  std::vector<PoseVector> others;
  const Eigen::Index n = optimum.pose.size();
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Unknown& unknown = scene.unknowns[k];
    if (unknown.component != Component::yaw) continue;
    const bool circular = period_of(scene, k) > 0;
    const bool follow = n > 1 && !compiled.coarse.empty();
    std::vector<Climbed> places;
    for (int j = 1; j < kYaws; ++j) {
      Climbed other{optimum.pose, 0, 0};
      other.pose[i] += j * unknown.range() / kYaws;
      if (!circular && other.pose[i] > unknown.upper) other.pose[i] -= unknown.range();
      wrap_pose(scene, other.pose);
      places.push_back(std::move(other));
    }
    if (follow) {
      follow_turns(objective, optimum, i, places);
      LinearSolution linear = optimum.linear;
      const double here =
          objective.evaluate(LightSource(compiled.coarse), optimum.pose, linear, true)
              .log_posterior;
      std::erase_if(places, [&](const Climbed& p) { return p.target < here - hopeless; });
    }
    for (Climbed& place : places) others.push_back(std::move(place.pose));
  }
  return others;
}

/// Where the last parts of descents from these places end, side by side.
std::vector<Refined> approach_all(const PoseObjective& objective,
                                  const std::vector<PoseVector>& places) {
  std::vector<Refined> reached(places.size());
  tbb::this_task_arena::isolate([&] {
    tbb::parallel_for(std::size_t{0}, places.size(),
                      [&](std::size_t i) { reached[i] = approach_closely(objective, places[i]); });
  });
  return reached;
}

/// Whether closed-form light is too rough at a place to lead from there, though it is good at the
/// optimum.
bool misled(const PoseObjective& objective, const Refined& optimum, const PoseVector& place) {
  const CompiledScene& compiled = objective.compiled();
  if (compiled.coarse.empty() || compiled.spline) return false;
  const auto lacks = [&](const PoseVector& pose) {
    LinearSolution linear = optimum.linear;
    const double model = objective.evaluate(objective.models(), pose, linear, true).log_posterior;
    return objective.evaluate(LightSource(compiled.coarse), pose, linear, true).log_posterior -
           model;
  };
  return std::abs(lacks(place) - lacks(optimum.pose)) > kTooRough;
}

/// Looks for a better place of the best optimum when it is turned, until there is none; by the
/// model where closed-form light is too rough to lead there, and there is no spline.
std::vector<Refined> turn(const PoseObjective& objective, double negligible, double roughness,
                          std::vector<Refined> optima) {
  const CompiledScene& compiled = objective.compiled();
  const bool by_model = roughness > kTooRough && !compiled.spline;
  // Closed form may be off by its roughness at either place.
  const double hopeless = kBeforeModel * negligible + 2 * roughness;
  for (int round = 0; round < kMaxRounds; ++round) {
    std::vector<PoseVector> places = turned(objective, optima.front(), hopeless);
    if (places.empty()) break;
    const double before = optima.front().value.log_posterior;
    // Where closed form fails at the best other place only, the model leads from that one.
    const bool led_astray = !by_model && misled(objective, optima.front(), places.front());
    if (led_astray) places.resize(1);
    if (!by_model && !led_astray) {
      const auto reached = merge(compiled, approach_all(objective, places), negligible);
      places.clear();
      for (const Refined& place : reached) {
        if (place.value.log_posterior < before - kBeforeModel * negligible) break;
        const bool known = std::ranges::any_of(optima, [&](const Refined& optimum) {
          return same_place(compiled, optimum.pose, place.pose);
        });
        if (!known) places.push_back(place.pose);
      }
      if (places.empty()) break;
      optima = polish_all(objective, places, negligible, std::move(optima));
    } else {
      optima = descend_all(objective, places, negligible, std::move(optima));
    }
    if (optima.front().value.log_posterior < before + kWorthAnother) break;
  }
  return optima;
}

class Stopwatch {
 public:
  /// Milliseconds since the last call.
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double ms = std::chrono::duration<double, std::milli>(now - start_).count();
    start_ = now;
    return ms;
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// A scene compiled for certain sensor placements.
struct Prepared {
  std::vector<SensorPlacement> placements;
  std::once_flag once;
  std::unique_ptr<CompiledScene> compiled;
  /// With the ranges near the relay, where these are a small part; its finer grid gives starts.
  /// Null until a fit searches: a frame that is tracked does not.
  std::once_flag near_once;
  std::unique_ptr<CompiledScene> near;
  std::unique_ptr<MovedModels> moved;
  std::unique_ptr<FalseAlarmCalibration> false_alarms;  ///< null until somebody asks
  std::atomic<std::size_t> bytes{0};                    ///< 0 until it is compiled

  /// For who has fitted with this.
  void count_bytes() { bytes = compiled->bytes() + (near ? near->bytes() : 0); }
};

bool same(const std::vector<SensorPlacement>& a, const std::vector<SensorPlacement>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const SensorPlacement& x, const SensorPlacement& y) {
                      return x.T_world_sensor.isApprox(y.T_world_sensor, 1e-12) &&
                             std::equal(x.relay_points.begin(), x.relay_points.end(),
                                        y.relay_points.begin(), y.relay_points.end(),
                                        [](const Eigen::Vector3d& p, const Eigen::Vector3d& q) {
                                          return p == q || (!p.allFinite() && !q.allFinite());
                                        });
                    });
}

std::unique_ptr<MovedModels> move_sensor(const std::vector<SensorPlacement>& placements,
                                         const CompiledScene& compiled) {
  auto moved = std::make_unique<MovedModels>();
  for (std::size_t i = 0; i < 6; ++i) {
    moved->step[i] = kSensorStep;
    for (const double sign : {1.0, -1.0}) {
      ModelSet& set = sign > 0 ? moved->plus[i] : moved->minus[i];
      FastModelOptions fast;
      fast.sampling_step = compiled.models().front()->sampling_step();
      for (SensorPlacement placement : placements) {
        if (i < 3) {
          placement.T_world_sensor.translation()[static_cast<int>(i)] += sign * kSensorStep;
        } else {
          placement.T_world_sensor.linear() =
              Eigen::AngleAxisd(sign * kSensorStep,
                                Eigen::Vector3d::Unit(static_cast<int>(i) - 3)) *
              placement.T_world_sensor.linear();
        }
        set.push_back(make_fast_model(compiled.knowledge->transport(), placement, fast));
      }
    }
  }
  return moved;
}

/// The answer to a capture without a single photon: the prior, and how likely darkness is.
void answer_darkness(const CompiledScene& compiled, const Observation& observation,
                     FitResult& result) {
  const Scene& scene = compiled.scene;
  PoseMode mode;
  mode.weight = 1;
  const auto n = static_cast<Eigen::Index>(scene.unknowns.size());
  mode.pose.resize(n);
  mode.covariance.setZero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const PriorMoments prior = prior_moments(scene, static_cast<std::size_t>(i));
    mode.pose[i] = prior.mean;
    mode.covariance(i, i) = prior.variance;
    mode.undetermined.push_back(static_cast<int>(i));
  }
  mode.optimum = mode.pose;
  // P(no photon | object) averaged over poses and the amplitude's prior; P(no photon | empty) = 1.
  const AmplitudePrior& prior = scene.linear.amplitude_prior;
  double dark = 0;
  int count = 0;
  const std::size_t stride = std::max<std::size_t>(1, compiled.templates().poses() / 500);
  for (std::size_t i = 0; i < compiled.templates().poses(); i += stride) {
    const double light = observation.likelihood.front()->scale() * compiled.templates().sum(i);
    for (int k = -4; k <= 4; ++k) {
      const double u = 0.5 * k;
      const double a = prior.median * std::exp(prior.sigma_log * u);
      dark += std::exp(-a * light - 0.5 * u * u) * 0.5 / std::sqrt(2 * kPi);
    }
    ++count;
  }
  result.posterior.modes = {mode};
  result.posterior.mean = mode.pose;
  result.posterior.covariance = mode.covariance;
  result.posterior.presence_probability =
      presence_probability(std::log(dark / count), 0.0, scene.presence_prior);
  result.false_alarm_probability = 1;
  result.flags = {"no_photons", "nothing_detected"};
}

/// Mixes the prior into mean and covariance of the whole posterior, for captures that something
/// unknown has disturbed: no small covariance may come of a capture that the model does not
/// explain.
void allow_for_outliers(const Scene& scene, PoseMixture& mixture) {
  const double share = scene.outlier_probability;
  if (share <= 0 || mixture.mean.size() == 0) return;
  const auto n = static_cast<Eigen::Index>(scene.unknowns.size());
  PoseVector difference(n);
  Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const PriorMoments prior = prior_moments(scene, k);
    // On a circle the prior has no mean: only its spread counts.
    const bool circular = period_of(scene, k) > 0;
    difference[i] = circular ? 0.0 : prior.mean - mixture.mean[i];
    spread(i, i) = prior.variance;
  }
  mixture.mean += share * difference;
  mixture.covariance = (1 - share) * mixture.covariance + share * spread +
                       share * (1 - share) * difference * difference.transpose();
}

/// `left_over` as of UnexplainedLight::probability().
void set_flags(const Scene& scene, const Posterior& posterior, double left_over,
               FitResult& result) {
  const auto flag = [&](bool condition, const char* word) {
    if (condition) result.flags.emplace_back(word);
  };
  const PoseMixture& mixture = posterior.mixture;
  flag(result.false_alarm_probability.value_or(1) > kAlarm &&
           result.posterior.presence_probability < kNoEvidence,
       "nothing_detected");
  flag(mixture.modes.size() > 1 && mixture.modes.front().weight < kOneMode, "multimodal");
  flag(!mixture.modes.front().undetermined.empty(), "undetermined");
  flag(result.goodness_of_fit.inflation > 1, "model_misfit");
  flag(left_over < kUnexplained, "unexplained_light");
  flag(posterior.sampled, "sampled");
  flag(posterior.sampled && posterior.effective_samples < kFewEffective, "few_effective_samples");
  bool at_bound = false;
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    if (period_of(scene, i) > 0) continue;
    const double value = mixture.modes.front().optimum[static_cast<Eigen::Index>(i)];
    const double margin = 1e-6 * scene.unknowns[i].range();  // far below any posterior's width
    at_bound = at_bound || value < scene.unknowns[i].lower + margin ||
               value > scene.unknowns[i].upper - margin;
  }
  flag(at_bound, "at_bound");
}

/// What the counts miss of the log likelihood that is expected at a right optimum; 0 where that may
/// be photon noise by this many standard deviations.
double unexplained(const PoseObjective& objective, const Refined& optimum, double deviations = 0) {
  const GoodnessOfFit fit = goodness_of_fit(objective, optimum);
  const double excess = fit.deviance - fit.expected;
  return excess > deviations * fit.standard_deviation ? 0.5 * excess : 0.0;
}

/// What closed-form light may be off by in log posterior: what it is at an optimum, or what that
/// optimum lacks of a right one; 0 where no closed form is used.
double roughness_of_closed_form(const PoseObjective& objective, const Refined& optimum) {
  if (objective.compiled().coarse.empty()) return 0;
  LinearSolution linear = optimum.linear;
  const LightSource light(objective.compiled().coarse);
  const double value = objective.evaluate(light, optimum.pose, linear, true).log_posterior;
  return std::max(std::abs(value - optimum.value.log_posterior),
                  unexplained(objective, optimum, kNoNoise));
}

/// Samples in proportion to the cube of the number of unknowns, of which three and fewer ask for
/// the options' number: the more directions there are, the more of them may have tails. With half
/// of it for two unknowns, ends of a ball's ridges (mirror_wall, 2000 captures) were missed: .937
/// instead of .952 of truths in the 95 % region. With twice as many for the six unknowns of two
/// spheres (10,000 photons), the normalised error is 1.27 where forty times as many have 1.16. A
/// joint fit of many captures pays for each sample as many times: a quarter of them does.
int samples_for(const FitOptions& options, const Scene& scene, std::size_t captures) {
  const auto n = static_cast<double>(scene.unknowns.size());
  const double dear = captures < kTimesFew * kFew ? 1 : 4;
  return static_cast<int>(options.importance_samples * std::max(std::pow(n / 3, 3), 1.0) / dear);
}

/// Captures whose sensors stand as far apart as possible: each is the farthest one from those
/// before it, the first the farthest from the middle. Of equal ones the first.
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

/// Of several objects, looks for a better place of one while the others stay, until there is none.
std::vector<Refined> rearrange(const PoseObjective& objective, const Observation& observation,
                               double negligible, std::vector<Refined> optima) {
  for (int round = 0; round < kMaxRounds; ++round) {
    const Refined& top = optima.front();
    const double before = top.value.log_posterior;
    const std::vector<PoseVector> places =
        other_places(objective, top.pose, top.linear, top.correction, kPlacesEach);
    optima = find_more(objective, observation, places, negligible, std::move(optima));
    if (optima.front().value.log_posterior < before + kWorthAnother) break;
  }
  return optima;
}

void validate_scene(const Scene& scene) {
  validate(scene);
  if (scene.unknowns.empty()) {
    throw Error(scene_place(scene),
                "unknowns: found none, accepted: at least one component to fit");
  }
  check_relay_visible(scene);
}

}  // namespace

void FitOptions::validate() const {
  const auto require = [](bool condition, const char* field, const char* accepted) {
    if (!condition)
      throw Error(std::string("FitOptions.") + field, std::string("accepted: ") + accepted);
  };
  require(!model_tolerance || (*model_tolerance > 0 && *model_tolerance < 1), "model_tolerance",
          "between 0 and 1");
  require(max_scored_poses >= 1, "max_scored_poses", "at least 1");
  require(max_closed_form_poses >= 1, "max_closed_form_poses", "at least 1");
  require(captures_per_placement >= 1, "captures_per_placement", "at least 1");
  require(max_starts >= 1, "max_starts", "at least 1");
  require(negligible_log_posterior > 0, "negligible_log_posterior", "above 0");
  require(importance_samples >= 0, "importance_samples", "at least 0");
  require(empty_captures == 0 || empty_captures >= 16, "empty_captures", "0 or at least 16");
}

struct Fitter::Impl {
  Scene scene;
  FitOptions options;
  std::shared_ptr<const SceneKnowledge> knowledge;
  std::mutex mutex;
  std::list<std::shared_ptr<Prepared>> prepared;  ///< last used first
  std::once_flag home_once;
  std::shared_ptr<Prepared> home;  ///< at the scene's own sensor placement; kept
  std::once_flag hints_once;
  std::vector<std::string> hints;  ///< about the scene, from the first capture's sensor placement

  void doing(const char* what) const {
    if (options.progress) options.progress(what, 0);
  }

  /// The scene compiled for these placements; compiled once, by whoever comes first.
  std::shared_ptr<Prepared> prepare(const std::vector<SensorPlacement>& placements) {
    std::shared_ptr<Prepared> entry = find(placements);
    std::call_once(entry->once, [&] {
      entry->compiled = compile(scene, placements, options, grid_options(), knowledge);
      if (scene.sensor_covariance) entry->moved = move_sensor(placements, *entry->compiled);
      entry->bytes = entry->compiled->bytes();
    });
    drop_least_used();
    return entry;
  }

  GridOptions grid_options() const {
    GridOptions grid;
    grid.closed_form = options.captures_per_placement < kManyCaptures;
    grid.max_poses = grid.closed_form && knowledge->coarse() ? options.max_closed_form_poses
                                                             : options.max_scored_poses;
    grid.closed_form_poses = options.max_closed_form_poses;
    return grid;
  }

  /// The part near the relay, where the scene needs one; null where it does not.
  const CompiledScene* near_relay(Prepared& whole) const {
    std::call_once(whole.near_once, [&] {
      const auto ranges = ranges_near_relay(scene);
      if (!ranges || whole.compiled->coarse.empty()) return;
      Scene part = scene;
      part.unknowns = *ranges;
      whole.near = compile(part, whole.placements, options, grid_options(), knowledge);
    });
    return whole.near.get();
  }

  /// What is known about empty captures. Their law hardly depends on where the sensor stands: that
  /// of the scene's own sensor placement serves all single captures of a sensor that moves.
  /// Kept for as long as this is: other threads may be asking it while the cache lets it go.
  FalseAlarmCalibration& false_alarms(const std::shared_ptr<Prepared>& own) {
    std::shared_ptr<Prepared> place = own;
    const std::vector<SensorPlacement> at_home{sensor_placement(scene)};
    if (own->placements.size() == 1 && own->placements.front().relay_points.empty() &&
        at_home.front().relay_points.empty()) {
      std::call_once(home_once, [&] { home = prepare(at_home); });
      place = home;
    }
    const std::scoped_lock lock(mutex);
    if (!place->false_alarms) {
      place->false_alarms = std::make_unique<FalseAlarmCalibration>(place->compiled.get());
    }
    return *place->false_alarms;
  }

  std::shared_ptr<Prepared> find(const std::vector<SensorPlacement>& placements) {
    const std::scoped_lock lock(mutex);
    for (auto it = prepared.begin(); it != prepared.end(); ++it) {
      if (!same((*it)->placements, placements)) continue;
      prepared.splice(prepared.begin(), prepared, it);
      return prepared.front();
    }
    prepared.push_front(std::make_shared<Prepared>());
    prepared.front()->placements = placements;
    return prepared.front();
  }

  void drop_least_used() {
    const std::scoped_lock lock(mutex);
    std::size_t bytes = 0;
    for (auto it = prepared.begin(); it != prepared.end();) {
      bytes += (*it)->bytes;
      const bool keep = it == prepared.begin() || bytes <= options.cache_bytes || (*it)->bytes == 0;
      it = keep ? std::next(it) : prepared.erase(it);
    }
  }

  /// Starts from a part of the search region, with their log posterior in the whole one.
  void add_starts(const CompiledScene& part, std::span<const Capture> captures,
                  const PoseObjective& whole, Scored& scored) const {
    const Observation observation = observe(part, captures);
    const PoseObjective objective(part, observation);
    LinearSolution empty;
    objective.evaluate_empty(empty);
    const LightSource light(whole.compiled().coarse);
    for (Candidate& start :
         score(objective, empty, options.max_starts, options.negligible_log_posterior).starts) {
      LinearSolution linear;
      start.index = -1;
      start.log_posterior = whole.evaluate(light, start.pose, linear, false).log_posterior;
      scored.starts.push_back(std::move(start));
    }
    std::ranges::stable_sort(scored.starts, std::greater{}, &Candidate::log_posterior);
  }

  struct Search {
    std::vector<Refined> optima;     ///< best first
    std::vector<PoseVector> places;  ///< from which better models may search again
    double negligible = 0;           ///< log posterior below the best that may be dropped
    double roughness = 0;            ///< of closed form, in log posterior
    long renders = 0;                ///< of an objective of its own
  };
  Search search(const PoseObjective& objective, const Scored& scored) const;
  std::optional<Search> search_by_few(std::span<const Capture> captures);
  Search on_all(const PoseObjective& objective, const Search& few) const;

  FitResult fit(std::span<const Capture> captures);
};

/// Every basin that the scored poses lead to, and its optimum on the objective's models.
Fitter::Impl::Search Fitter::Impl::search(const PoseObjective& objective,
                                          const Scored& scored) const {
  const CompiledScene& compiled = objective.compiled();
  std::vector<Refined> basins;
  std::vector<PoseVector> approached;  // with a wide pulse
  double best = -std::numeric_limits<double>::infinity();
  double largest_gain = 0;
  for (std::size_t next = 0; next < scored.starts.size();) {
    // A start that would have to gain twice what any of three or more has gained so far cannot win.
    std::vector<const Candidate*> chosen;
    for (; next < scored.starts.size() && chosen.size() < kStartsAtOnce; ++next) {
      const Candidate& start = scored.starts[next];
      // Light of several objects is too rough in closed form to say so.
      const bool hopeless = compiled.objects().empty() && basins.size() >= 3 &&
                            start.log_posterior + 2 * largest_gain <
                                best - kBeforeModel * options.negligible_log_posterior;
      if (!hopeless) chosen.push_back(&start);
    }
    // Of those that a wide pulse brings to the same place one will do.
    std::vector<PoseVector> places;
    for (const Candidate* start : chosen) places.push_back(start->pose);
    places = approach_widely(objective, places);
    std::vector<std::size_t> apart;
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      const bool double_start = compiled.widths.size() > 1 &&
                                std::ranges::any_of(approached, [&](const PoseVector& other) {
                                  return same_place(compiled, other, places[i]);
                                });
      if (double_start) continue;
      approached.push_back(places[i]);
      apart.push_back(i);
    }
    std::vector<PoseVector> left;
    for (const std::size_t i : apart) left.push_back(places[i]);
    std::vector<Refined> reached = approach_all(objective, left);
    for (std::size_t i = 0; i < apart.size(); ++i) {
      const double here = reached[i].value.log_posterior;
      best = std::max(best, here);
      largest_gain = std::max(largest_gain, here - chosen[apart[i]]->log_posterior);
      basins.push_back(std::move(reached[i]));
    }
  }
  // The models' own error must not decide which basins are dropped: what the best one misses of its
  // expectation, a better model may give to another.
  basins = merge(compiled, std::move(basins), std::numeric_limits<double>::infinity());
  double negligible = options.negligible_log_posterior;
  if (!basins.empty()) negligible += unexplained(objective, basins.front());
  std::vector<PoseVector> places;
  for (const Refined& basin : basins) {
    const double least = basins.front().value.log_posterior - kBeforeModel * negligible;
    if (basin.value.log_posterior < least) break;
    places.push_back(basin.pose);
  }
  std::vector<Refined> optima = polish_all(objective, places, negligible);
  if (const auto lost = places_left(compiled, basins, optima); !lost.empty()) {
    optima = descend_all(objective, lost, negligible, std::move(optima));
  }
  if (optima.empty()) return {};
  const double roughness = roughness_of_closed_form(objective, optima.front());
  if (roughness > kTooRough) {
    const std::vector<PoseVector> more =
        best_by_model(objective, scored, kMorePlaces, kRoughElsewhere * roughness);
    if (roughness > kNoGuide) {
      optima = descend_all(objective, more, negligible, std::move(optima));
      places.clear();  // where closed form had led
    } else {
      places.insert(places.end(), more.begin(), more.end());
      optima = polish_all(objective, more, negligible, std::move(optima));
    }
  }
  optima = turn(objective, negligible, roughness, std::move(optima));
  return {std::move(optima), std::move(places), negligible, roughness};
}

/// The search by a few captures of many, from places as far apart as any: what costs a model of
/// each capture at every step of every descent is done for a few of them. Nothing where there are
/// few anyway, or where these do not see the object so clearly that no other place could win.
std::optional<Fitter::Impl::Search> Fitter::Impl::search_by_few(std::span<const Capture> captures) {
  if (captures.size() < kTimesFew * kFew) return std::nullopt;
  std::vector<SensorPlacement> placements;
  std::vector<Capture> few;
  for (const std::size_t i : spread_out(scene, captures, kFew)) {
    few.push_back(captures[i]);
    placements.push_back(sensor_placement(scene, &captures[i]));
  }
  const std::shared_ptr<Prepared> known = prepare(placements);
  const Observation observation = observe(*known->compiled, few);
  if (observation.zones.empty()) return std::nullopt;
  if (observation.likelihood.front()->counts_photons() && observation.total_count() <= 0) {
    return std::nullopt;
  }
  const PoseObjective objective(*known->compiled, observation);
  LinearSolution empty;
  const PoseValue nothing = objective.evaluate_empty(empty);
  Scored scored = score(objective, empty, options.max_starts, options.negligible_log_posterior);
  if (const CompiledScene* part = near_relay(*known)) add_starts(*part, few, objective, scored);
  Search found = search(objective, scored);
  found.renders = objective.renders();
  if (found.optima.empty()) return std::nullopt;
  const Refined& top = found.optima.front();
  const double inflation = goodness_of_fit(objective, top).inflation;
  const double gain = (top.value.log_posterior - nothing.log_posterior) / inflation;
  // What misfit costs every place alike makes none of them better.
  const double least = top.value.log_posterior - inflation * options.negligible_log_posterior;
  std::erase_if(found.optima,
                [&](const Refined& other) { return other.value.log_posterior < least; });
  if (found.optima.size() > kFewOptima) return std::nullopt;
  known->count_bytes();
  if (gain < kClear) return std::nullopt;
  return found;
}

/// The same places by all captures.
Fitter::Impl::Search Fitter::Impl::on_all(const PoseObjective& objective, const Search& few) const {
  Search all = few;
  all.optima.clear();
  all.places.clear();
  for (const Refined& optimum : few.optima) all.places.push_back(optimum.pose);
  constexpr double kAll = std::numeric_limits<double>::infinity();
  all.optima = objective.compiled().coarse.empty() ? polish_all(objective, all.places, kAll)
                                                   : descend_all(objective, all.places, kAll, {});
  if (!all.optima.empty()) {
    all.negligible = options.negligible_log_posterior + unexplained(objective, all.optima.front());
  }
  return all;
}

/// The method, top to bottom.
FitResult Fitter::Impl::fit(std::span<const Capture> captures) {
  Stopwatch total;
  Stopwatch stage;
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
  const std::shared_ptr<Prepared> known = prepare(placements);
  const CompiledScene& compiled = *known->compiled;
  const Observation observation = observe(compiled, captures);
  PoseObjective objective(compiled, observation);
  result.time_ms.prepare = stage.lap();
  if (observation.zones.empty()) {
    throw Error(captures.front().source, "found no zone with valid bins, accepted: at least one");
  }
  if (observation.likelihood.front()->counts_photons() && observation.total_count() <= 0) {
    answer_darkness(compiled, observation, result);
    for (const Capture& capture : captures) {
      FittedHistograms dark;
      dark.measured = capture.counts;
      dark.model = dark.object =
          HistogramCube(capture.counts.rows, capture.counts.columns, capture.counts.bins);
      dark.zone_used.assign(static_cast<std::size_t>(capture.counts.zones()), true);
      dark.amplitude.assign(dark.zone_used.size(), 0.0);
      dark.ambient = dark.direct = dark.amplitude;
      dark.end_bin = capture.counts.bins;
      result.histograms.push_back(std::move(dark));
    }
    result.time_ms.total = total.lap();
    return result;
  }

  // The scene without an object; every pose on the grid; the best ones refined.
  doing("scoring");
  LinearSolution empty;
  const PoseValue nothing = objective.evaluate_empty(empty);
  Scored scored = score(objective, empty, options.max_starts, options.negligible_log_posterior);
  if (const CompiledScene* part = near_relay(*known)) {
    add_starts(*part, captures, objective, scored);
  }
  result.time_ms.score = stage.lap();
  doing("refining");
  Search found;
  if (auto few = search_by_few(captures)) found = on_all(objective, *few);
  if (found.optima.empty()) found = search(objective, scored);
  if (found.optima.empty()) {
    throw Error(captures.front().source, "found no finite likelihood at any pose");
  }
  std::vector<Refined>& optima = found.optima;
  // Models as good as the light asks for.
  ModelError model_error;
  if (!options.model_tolerance) {
    model_error = sharpen(objective, optima, found.places, found.negligible);
  }
  optima = settle_all(objective, std::move(optima), found.negligible);
  if (!compiled.objects().empty() && found.roughness > kTooRough) {
    optima = rearrange(objective, observation, found.negligible, std::move(optima));
  }
  result.time_ms.refine = stage.lap();

  // How sure: goodness of fit, Fisher information, evidences.
  doing("weighing explanations");
  PosteriorOptions sampling;
  sampling.negligible = options.negligible_log_posterior;
  sampling.samples = samples_for(options, scene, captures.size());
  sampling.seed = options.seed;
  sampling.model_error = background_covariance(objective, optima.front());
  if (!options.model_tolerance) sampling.model_error += model_error.covariance;
  const auto think = [&] {
    result.goodness_of_fit = goodness_of_fit(objective, optima.front());
    sampling.inflation = result.goodness_of_fit.inflation;
    return blindcorner::posterior(objective, optima, &scored, known->moved.get(), sampling);
  };
  Posterior posterior = think();
  for (int again = 0; again < kMaxReturns && !posterior.promising.empty(); ++again) {
    // Sampling came upon places that may be better: refine from there and, if so, think again.
    const double before = optima.front().value.log_posterior;
    optima = find_more(objective, observation, posterior.promising,
                       options.negligible_log_posterior, std::move(optima));
    if (optima.front().value.log_posterior < before + kWorthAnother * sampling.inflation) break;
    posterior = think();
  }
  result.posterior = posterior.mixture;
  allow_for_outliers(scene, result.posterior);
  const double left_over = unexplained_light(objective, optima.front()).probability();
  result.time_ms.uncertainty = stage.lap();

  // Is there anything at all?
  doing("comparing with empty captures");
  const double log_evidence_empty =
      nothing.log_integrand - nothing.log_likelihood * (1 - 1 / sampling.inflation);
  result.posterior.presence_probability =
      presence_probability(posterior.log_evidence, log_evidence_empty, scene.presence_prior);
  if (options.empty_captures > 0) {
    result.false_alarm_probability =
        false_alarms(known).probability(objective, empty, options.empty_captures, options.seed);
  }
  result.time_ms.detect = stage.lap();
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
  result.time_ms.total = total.lap();
  return result;
}

Fitter::Fitter(Scene scene, FitOptions options) : impl_(std::make_unique<Impl>()) {
  options.validate();
  validate_scene(scene);
  impl_->scene = std::move(scene);
  impl_->knowledge = std::make_shared<const SceneKnowledge>(impl_->scene);
  impl_->options = std::move(options);
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
      impl_->prepare({sensor_placement(impl_->scene, &capture)});
  return make_capture_likelihood({known, known->compiled.get()}, capture, impl_->options);
}

const Scene& Fitter::scene() const { return impl_->scene; }

FitResult fit(const Scene& scene, const Capture& capture, const FitOptions& options) {
  return Fitter(scene, options).fit(capture);
}

}  // namespace blindcorner
