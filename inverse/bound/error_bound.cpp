// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/bound/error_bound.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <mutex>
#include <numbers>
#include <numeric>

#include "blindcorner/forward/error.h"
#include "forward/support/parallel.h"
#include "inverse/bound/ambiguity.h"
#include "inverse/bound/look_alike.h"
#include "inverse/likelihood/background_error.h"
#include "inverse/likelihood/light_slope.h"
#include "inverse/posterior/detection.h"
#include "inverse/posterior/fisher_information.h"
#include "inverse/posterior/prior_moments.h"

namespace blindcorner {
namespace {

/// Test poses whose squared Bhattacharyya coefficient with the true pose is below this are left
/// out: none adds more than about that share of its squared distance to the bound.
constexpr double kNegligible = 1e-6;
/// Most poses whose mutual confusion is computed. Of more poses, this many are taken in proportion
/// to their weights. By judgement: the time grows with the square of their number.
constexpr std::size_t kMaxPoses = 128;
/// Least information, as a share of the prior's: less counts as none, and the error is then a
/// million times the prior's.
constexpr double kNoInformation = 1e-12;

/// Points [n, count] that fill the unit cube evenly: multiples of g^-1 to g^-n, modulo one, where g
/// is the root of g^(n+1) = g + 1 (Roberts' extension of the golden ratio to n dimensions).
Eigen::MatrixXd even_points(Eigen::Index n, Eigen::Index count) {
  // Each step at least halves the error, so that 60 end at rounding.
  double g = 1.5;
  for (int i = 0; i < 60; ++i) g = std::pow(1 + g, 1.0 / (static_cast<double>(n) + 1));
  Eigen::MatrixXd points(n, count);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double step = std::pow(g, -static_cast<double>(i + 1));
    for (Eigen::Index k = 0; k < count; ++k) {
      const double value = 0.5 + step * static_cast<double>(k + 1);
      points(i, k) = value - std::floor(value);
    }
  }
  return points;
}

/// An observation without a count: only its zones, bins and noise matter.
Observation blank_observation(const CompiledScene& compiled, const BoundOptions& options,
                              const LinearSolution* expected) {
  const Sensor& sensor = compiled.scene.sensor;
  Capture capture;
  capture.counts = HistogramCube(sensor.rows, sensor.columns, sensor.bins);
  capture.exposures = options.exposures;
  Observation observation = observe(compiled.scene, {&capture, 1}, compiled.gates);
  if (expected != nullptr) weigh(compiled, *expected, observation);
  return observation;
}

/// Inverse of an information matrix. Directions that have no information, in units of the prior's
/// standard deviations, get a huge variance.
Eigen::MatrixXd covariance_of(const Eigen::MatrixXd& information, const Eigen::MatrixXd& prior) {
  const Eigen::VectorXd scale = prior.diagonal().cwiseSqrt();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scale.asDiagonal() * information *
                                                              scale.asDiagonal());
  const Eigen::VectorXd inverse = solver.eigenvalues().cwiseMax(kNoInformation).cwiseInverse();
  return scale.asDiagonal() * solver.eigenvectors() * inverse.asDiagonal() *
         solver.eigenvectors().transpose() * scale.asDiagonal();
}

/// Value that a standard normal variable exceeds with probability kAlarm = 5 %.
constexpr double kAlarmDeviate = 1.645;

double normal_share(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

/// Indices of as many entries as wanted, in proportion to the weights and evenly spaced along the
/// list. An index may come more than once.
std::vector<std::size_t> in_proportion(const Eigen::VectorXd& weights, std::size_t wanted) {
  std::vector<std::size_t> chosen;
  const double step = weights.sum() / static_cast<double>(wanted);
  double next = 0.5 * step, sum = 0;
  for (Eigen::Index k = 0; k < weights.size(); ++k) {
    sum += weights[k];
    for (; next < sum && chosen.size() < wanted; next += step) {
      chosen.push_back(static_cast<std::size_t>(k));
    }
  }
  return chosen;
}

}  // namespace

void BoundOptions::validate() const {
  const auto require = [](bool condition, const char* field, const char* accepted) {
    if (!condition)
      throw Error(std::string("BoundOptions.") + field, std::string("accepted: ") + accepted);
  };
  require(exposures > 0 && std::isfinite(exposures), "exposures", "above 0");
  require(ambient >= 0 && std::isfinite(ambient), "ambient", "at least 0");
  require(test_poses >= 1 && test_poses <= 100'000, "test_poses", "1 to 100000");
  require(model_tolerance > 0 && model_tolerance < 1, "model_tolerance", "between 0 and 1");
  require(empty_captures >= 16, "empty_captures", "at least 16");
}

double position_trace(const Scene& scene, const Eigen::MatrixXd& covariance) {
  double sum = 0;
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    if (scene.unknowns[i].component <= Component::z) sum += covariance(k, k);
  }
  return sum;
}

struct ErrorBound::Impl {
  BoundOptions options;
  std::unique_ptr<CompiledScene> compiled;
  LinearSolution expected;  ///< true linear unknowns, with an object
  LinearSolution empty;     ///< without one
  std::unique_ptr<Observation> observation;
  std::unique_ptr<PoseObjective> objective;
  std::unique_ptr<MatchedFilter> filter;
  std::vector<int> zone_begin;  ///< [zones + 1] rows
  Eigen::MatrixXd prior, precision;
  /// Results that need the whole search region, computed once by look_around().
  std::once_flag looked_around;
  double threshold = 0;  ///< gain in log likelihood that a fit calls a detection
  std::vector<PoseVector> test_poses;
  Eigen::VectorXd log_prior;  ///< [test poses]
  TestLight test;

  Impl(const Scene& scene, const SensorPlacement& placement, const BoundOptions& wanted,
       const Advance& advance);
  void look_around(const Advance& advance = {});
  void render_test_poses(const Advance& advance);
  Eigen::MatrixXd slope_at(const PoseVector& pose, const ShapeBuffer& light) const;
  /// Linear unknowns when the object is `brightness` times as bright as expected.
  LinearSolution with_brightness(double brightness) const;
  Eigen::MatrixXd ambiguity_at(const PoseVector& pose, const ShapeBuffer& light,
                               const LinearSolution& linear) const;
  double detection_at(const ShapeBuffer& light, const LinearSolution& linear) const;
};

ErrorBound::Impl::Impl(const Scene& scene, const SensorPlacement& placement,
                       const BoundOptions& wanted, const Advance& advance)
    : options(wanted) {
  options.validate();
  if (scene.unknowns.empty()) {
    throw Error(scene_place(scene), "unknowns: found none, accepted: at least one");
  }
  FitOptions fit;
  fit.model_tolerance = options.model_tolerance;
  GridOptions grid;  // as for a single capture
  grid.closed_form = true;
  const auto knowledge = std::make_shared<const SceneKnowledge>(scene);
  grid.max_poses = knowledge->coarse() ? fit.max_closed_form_poses : fit.max_scored_poses;
  compiled = compile(scene, {placement}, fit, grid, knowledge);

  const LinearUnknowns& unknowns = scene.linear;
  const std::size_t zones = blank_observation(*compiled, options, nullptr).zones.size();
  if (zones == 0) {
    throw Error(scene_place(scene),
                "sensor: found no zone with valid bins, accepted: at least one");
  }
  expected.amplitude.assign(zones, unknowns.amplitude == LinearMode::fixed
                                       ? unknowns.fixed_amplitude
                                       : unknowns.amplitude_prior.median);
  expected.ambient.assign(
      zones, unknowns.ambient == LinearMode::fixed ? unknowns.fixed_ambient : options.ambient);
  expected.direct.assign(zones, unknowns.fixed_direct);
  empty = expected;
  empty.amplitude.assign(zones, 0.0);
  observation = std::make_unique<Observation>(blank_observation(*compiled, options, &empty));
  objective = std::make_unique<PoseObjective>(*compiled, *observation);
  filter = std::make_unique<MatchedFilter>(*objective, empty, MatchedFilter::Weights::expected,
                                           MatchedFilter::Priors::ignored);
  zone_begin.push_back(0);
  for (const ObservedZone& zone : observation->zones) {
    zone_begin.push_back(zone_begin.back() + zone.bins());
  }
  precision = prior_precision(scene);
  prior = precision.diagonal().cwiseInverse().asDiagonal();
  if (advance) look_around(advance);
}

void ErrorBound::Impl::look_around(const Advance& advance) {
  std::call_once(looked_around, [&] {
    threshold = simulate_empty(*compiled, empty_level(*objective, empty), options.empty_captures,
                               options.seed)
                    .exceeded_by(kAlarm);
    render_test_poses(advance);
  });
}

Eigen::MatrixXd ErrorBound::Impl::slope_at(const PoseVector& pose, const ShapeBuffer& light) const {
  Eigen::MatrixXd slope;
  light_slope(*objective, objective->models(), pose, light, Differences::central, slope);
  return slope;
}

void ErrorBound::Impl::render_test_poses(const Advance& advance) {
  const Scene& scene = compiled->scene;
  const auto n = static_cast<Eigen::Index>(scene.unknowns.size());
  const Eigen::Index count = options.test_poses;
  const Eigen::MatrixXd points = even_points(n, count);
  log_prior.resize(count);
  test.light.resize(objective->rows(), count);
  for (Eigen::Index k = 0; k < count; ++k) {
    PoseVector pose(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto u = static_cast<std::size_t>(i);
      const double period = period_of(scene, u);
      const double range = period > 0 ? period : scene.unknowns[u].range();
      pose[i] = scene.unknowns[u].lower + range * points(i, k);
    }
    log_prior[k] = log_pose_prior(scene, pose);
    test_poses.push_back(std::move(pose));
  }
  parallel_for(Eigen::Index{0}, count, [&](Eigen::Index k) {
    ShapeBuffer buffer;
    objective->shapes(objective->models(), test_poses[static_cast<std::size_t>(k)], buffer);
    test.light.col(k) = light_of(buffer);
    if (advance) advance();
  });
  test.square = test.light.cwiseAbs2();
}

LinearSolution ErrorBound::Impl::with_brightness(double brightness) const {
  LinearSolution linear = expected;
  for (double& amplitude : linear.amplitude) amplitude *= brightness;
  return linear;
}

// Poses count in proportion to their prior and to the share of their captures that they have in
// common with the true one. A method that is told that the object is at one of these poses can only
// do better.
Eigen::MatrixXd ErrorBound::Impl::ambiguity_at(const PoseVector& pose, const ShapeBuffer& light,
                                               const LinearSolution& linear) const {
  const Scene& scene = compiled->scene;
  const LookAlike look(objective->solver(), light.shapes, linear);
  const LookAlike::Confused confused = look.confused(test, kNegligible);
  const auto count = static_cast<Eigen::Index>(confused.index.size()) + 1;
  const double here = log_pose_prior(scene, pose);
  Eigen::MatrixXd points = Eigen::MatrixXd::Zero(pose.size(), count);
  Eigen::VectorXd weights(count);
  weights[0] = 1;
  for (Eigen::Index k = 1; k < count; ++k) {
    const Eigen::Index index = confused.index[static_cast<std::size_t>(k - 1)];
    points.col(k) = pose_difference(scene, pose, test_poses[static_cast<std::size_t>(index)]);
    weights[k] = std::exp(log_prior[index] - here - confused.roots.col(k).squaredNorm());
  }
  if (static_cast<std::size_t>(count) <= kMaxPoses) {
    return ambiguity_bound(points, weights / weights.sum(), confused.roots);
  }
  const std::vector<std::size_t> chosen = in_proportion(weights, kMaxPoses);
  const auto kept = static_cast<Eigen::Index>(chosen.size());
  Eigen::MatrixXd some(pose.size(), kept), roots(confused.roots.rows(), kept);
  for (Eigen::Index k = 0; k < kept; ++k) {
    const auto from = static_cast<Eigen::Index>(chosen[static_cast<std::size_t>(k)]);
    some.col(k) = points.col(from);
    roots.col(k) = confused.roots.col(from);
  }
  return ambiguity_bound(some, Eigen::VectorXd::Constant(kept, 1.0 / static_cast<double>(kept)),
                         roots);
}

// The score of the true pose is half the square of a normal deviate whose mean is the
// signal-to-noise ratio. The deviate's variance is larger than one where the object's own photons
// add to the noise. The best of all poses scores at least as much, so this is a lower bound. Empty
// captures pass the threshold as well, with the probability of a false alarm.
double ErrorBound::Impl::detection_at(const ShapeBuffer& light,
                                      const LinearSolution& linear) const {
  const double amplitude = linear.amplitude.front();
  const Eigen::VectorXd object = amplitude * light_of(light);
  const Eigen::VectorXf counts = filter->mean() + object.cast<float>();
  const Templates one(light_of(light).cast<float>(), zone_begin);
  const double ratio =
      std::sqrt(2 * std::max(static_cast<double>(filter->scores(one, counts)[0]), 0.0));
  double noise = 0, empty_noise = 0;
  for (std::size_t z = 0; z < observation->zones.size(); ++z) {
    const ObservedZone& zone = observation->zones[z];
    const BinLikelihood& noise_model = observation->noise_model(zone);
    for (int k = 0; k < zone.bins(); ++k) {
      const Eigen::Index row = zone_begin[z] + k;
      const double mean = noise_model.lit(filter->mean()[row]);
      const double variance = noise_model.variance(mean);
      const double share = zone.weight_of(k) * object[row] * object[row] / variance;
      empty_noise += share;
      noise += share * noise_model.variance(mean + object[row]) / variance;
    }
  }
  const double sigma = empty_noise > 0 ? std::sqrt(noise / empty_noise) : 1.0;
  // The best of all poses passes a threshold at least as often as any single pose, which passes as
  // often as a normal deviate. A threshold below that deviate's comes of a search region without
  // light, whose scores are all 0.
  const double needed = std::max(std::sqrt(2 * std::max(threshold, 0.0)), kAlarmDeviate);
  double seen = normal_share((ratio - needed) / sigma);
  // Few photons do not give a normal deviate: a capture without any photon of the object is an
  // empty one.
  const auto counts_photons = [&](const ObservedZone& zone) {
    return observation->noise_model(zone).counts_photons();
  };
  if (std::ranges::all_of(observation->zones, counts_photons)) {
    seen = std::min(seen, -std::expm1(-options.exposures * object.sum()));
  }
  return 1 - (1 - kAlarm) * (1 - seen);
}

ErrorBound::ErrorBound(const Scene& scene, const SensorPlacement& placement,
                       const BoundOptions& options, const Advance& advance)
    : impl_(std::make_unique<Impl>(scene, placement, options, advance)) {}
ErrorBound::~ErrorBound() = default;
ErrorBound::ErrorBound(ErrorBound&&) noexcept = default;
ErrorBound& ErrorBound::operator=(ErrorBound&&) noexcept = default;

PoseBound ErrorBound::at(const PoseVector& pose, double brightness) const {
  impl_->look_around();
  const Impl& own = *impl_;
  const LinearSolution linear = own.with_brightness(brightness);
  const Scene& scene = own.compiled->scene;
  ShapeBuffer light;
  own.objective->shapes(own.objective->models(), pose, light);
  PoseBound bound;
  bound.pose = pose;
  for (std::size_t z = 0; z < own.observation->zones.size(); ++z) {
    const ObservedZone& zone = own.observation->zones[z];
    const double sum =
        std::accumulate(light.shapes[z].object, light.shapes[z].object + zone.bins(), 0.0);
    bound.photons += linear.amplitude[z] * own.options.exposures * sum;
  }
  const Eigen::MatrixXd information =
      pose_information(*own.objective, light, linear, own.slope_at(pose, light)).pose;
  bound.cramer_rao = covariance_of(information, own.prior);
  bound.with_prior =
      own.options.prior ? covariance_of(information + own.precision, own.prior) : bound.cramer_rao;
  bound.ambiguity = own.ambiguity_at(pose, light, linear);
  const double local = position_trace(scene, bound.with_prior);
  const double elsewhere = position_trace(scene, bound.ambiguity);
  bound.ambiguous = elsewhere > local;
  bound.position_error = std::sqrt(std::max(local, elsewhere));
  bound.detection_probability = own.detection_at(light, linear);
  return bound;
}

Eigen::MatrixXd ErrorBound::cramer_rao(const PoseVector& pose, double brightness) const {
  const Impl& own = *impl_;
  ShapeBuffer light;
  own.objective->shapes(own.objective->models(), pose, light);
  const PoseInformation info = pose_information(
      *own.objective, light, own.with_brightness(brightness), own.slope_at(pose, light));
  return covariance_of(info.pose, own.prior);
}

// If the light is off by e, the estimate moves by I^-1 J' W e, where W is the inverse of the
// photons' variance and the linear unknowns are eliminated. Errors that are correlated within a
// zone are sums of independent errors: the columns of a root of their covariance.
Eigen::MatrixXd ErrorBound::carried_error(const PoseVector& pose, const HistogramCube& error,
                                          const Eigen::MatrixXd& correlation,
                                          double brightness) const {
  const Impl& own = *impl_;
  const Eigen::MatrixXd root = correlation.llt().matrixL();
  ShapeBuffer light;
  own.objective->shapes(own.objective->models(), pose, light);
  const LinearSolution linear = own.with_brightness(brightness);
  const Eigen::MatrixXd slope = own.slope_at(pose, light);
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(pose.size(), pose.size());
  for (std::size_t z = 0; z < own.observation->zones.size(); ++z) {
    const ObservedZone& zone = own.observation->zones[z];
    const double amplitude = linear.amplitude[z];
    if (amplitude == 0) continue;
    Eigen::MatrixXd disturbance = Eigen::MatrixXd::Zero(own.objective->rows(), root.cols());
    for (int k = 0; k < zone.bins(); ++k) {
      const int bin = zone.first + k;
      disturbance.row(own.zone_begin[z] + k) =
          zone.gain / amplitude * error.zone(zone.zone)[bin] * root.row(bin);
    }
    const PoseInformation info =
        pose_information(*own.objective, light, linear, slope, disturbance);
    const Eigen::MatrixXd moved = covariance_of(info.pose, own.prior) * info.disturbance;
    sum += moved * moved.transpose();
  }
  return sum;
}

const Eigen::MatrixXd& ErrorBound::prior() const { return impl_->prior; }

double ErrorBound::prior_error() const {
  return std::sqrt(position_trace(impl_->compiled->scene, impl_->prior));
}

}  // namespace blindcorner
