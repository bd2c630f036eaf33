// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/uncertainty.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "blindcorner/forward/constants.h"

namespace blindcorner {
namespace {

/// An unknown is called undetermined when its posterior keeps this share of the prior's width.
constexpr double kUndetermined = 0.8;
/// Laplace holds when the posterior 1.5 sigma from the optimum has fallen by 1.5^2/2, give or take
/// this factor, in every direction.
constexpr double kSigmaPoint = 1.5;
constexpr double kLaplaceFactor = 1.5;
/// Accuracy of a sample's log posterior.
constexpr double kAccuracy = 1e-3;
/// A sample this much above the best optimum shows a basin that was missed.
constexpr double kBetter = 0.02;
/// One apart from every optimum and at most this much below the best may lie in such a basin: least
/// squares gains about that much on a sample. Descents on a spline are so cheap, and so many, that
/// there only a better sample counts.
constexpr double kPromising = 1.0;
/// Modes are apart when every way between them falls this far below the lower one.
constexpr double kValley = 1.0;
/// Ways are looked at in 2^(k + 1) - 1 places, and bent only between modes that matter: at most
/// this much below the best.
constexpr int kRidgeHalvings = 1;
constexpr double kWorthBending = 5.0;
/// Modes closer than this (Mahalanobis) are one.
constexpr double kMergeDistance = 1.0;

/// Prior variance of one unknown: uniform on its range, times the normal prior.
double prior_variance(const Scene& scene, std::size_t i) {
  const Unknown& unknown = scene.unknowns[i];
  const double period = period_of(scene, i);
  const double range = period > 0 ? period : unknown.range();
  double precision = 12 / (range * range);
  if (unknown.prior) precision += 1 / (unknown.prior->sigma * unknown.prior->sigma);
  return 1 / precision;
}

Eigen::MatrixXd prior_precision(const Scene& scene) {
  const auto n = static_cast<Eigen::Index>(scene.unknowns.size());
  Eigen::MatrixXd precision = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    precision(i, i) = 1 / prior_variance(scene, static_cast<std::size_t>(i));
  }
  return precision;
}

/// Moments of the deviance of a Poisson count with mean mu: E[d], Var[d].
struct DevianceMoments {
  static constexpr double kLow = 1e-4, kHigh = 300;
  static constexpr int kSteps = 400;
  std::vector<double> mean, variance;

  DevianceMoments() {
    for (int i = 0; i <= kSteps; ++i) {
      const double mu = kLow * std::pow(kHigh / kLow, static_cast<double>(i) / kSteps);
      const int last = static_cast<int>(mu + 12 * std::sqrt(mu) + 30);
      double first = 0;
      double second = 0;
      double log_probability = -mu;
      for (int n = 0; n <= last; ++n) {
        if (n > 0) log_probability += std::log(mu / n);
        const double d = 2 * (n > 0 ? mu - n + n * std::log(n / mu) : mu);
        first += std::exp(log_probability) * d;
        second += std::exp(log_probability) * d * d;
      }
      mean.push_back(first);
      variance.push_back(second - first * first);
    }
  }

  void at(double mu, double& e, double& v) const {
    if (mu >= kHigh) {
      e = 1 + 1 / (6 * mu);
      v = 2;
      return;
    }
    const double x = std::max(std::log(mu / kLow) / std::log(kHigh / kLow) * kSteps, 0.0);
    const auto i = static_cast<std::size_t>(std::min(x, kSteps - 1.0));
    const double t = x - static_cast<double>(i);
    e = mean[i] * (1 - t) + mean[i + 1] * t;
    v = variance[i] * (1 - t) + variance[i + 1] * t;
    if (mu < kLow) {
      e *= mu / kLow;
      v *= mu / kLow;
    }
  }
};

const DevianceMoments& deviance_moments() {
  static const DevianceMoments moments;
  return moments;
}

/// Mean and variance of the deviance of a Gaussian-law count with mean m, by quadrature.
void gaussian_deviance_moments(const BinLikelihood& law, double m, double& e, double& v) {
  constexpr int kPoints = 24;
  const double sigma = std::sqrt(law.variance(m));
  double first = 0, second = 0, total = 0;
  for (int i = 0; i <= kPoints; ++i) {
    const double u = 8.0 * i / kPoints - 4;
    const double weight = std::exp(-0.5 * u * u);
    const double n = law.censored() ? std::max(m + sigma * u, 0.0) : m + sigma * u;
    const double d = 2 * (law.value(n, m) - law.least(n));
    first += weight * d;
    second += weight * d * d;
    total += weight;
  }
  e = first / total;
  v = second / total - e * e;
}

Peak make_peak(const PoseObjective& objective, const Refined& optimum, const MovedModels* moved,
               double inflation, Eigen::MatrixXd* sensor_covariance) {
  const Scene& scene = objective.compiled().scene;
  const Information info = information(objective, optimum, moved);
  Peak peak;
  peak.center = optimum.pose;
  const Eigen::MatrixXd precision = info.pose / inflation + prior_precision(scene);
  peak.covariance =
      precision.ldlt().solve(Eigen::MatrixXd::Identity(precision.rows(), precision.cols()));
  peak.covariance = 0.5 * (peak.covariance + peak.covariance.transpose().eval());
  peak.root = peak.covariance.llt().matrixL();
  peak.log_det = 2 * peak.root.diagonal().array().log().sum();
  peak.log_evidence = tempered(optimum.value, inflation) +
                      0.5 * static_cast<double>(peak.center.size()) * std::log(2 * kPi) +
                      0.5 * peak.log_det;
  if (moved != nullptr && sensor_covariance != nullptr && scene.sensor_covariance) {
    // The optimum moves by -I_tt^-1 I_ts ds when the sensor is not where it was said to be.
    const Eigen::MatrixXd gain = peak.covariance * info.pose_sensor / inflation;
    *sensor_covariance = gain * *scene.sensor_covariance * gain.transpose();
  }
  return peak;
}

/// Whether the posterior falls as the Gaussian says, in every principal direction.
bool laplace_holds(const PoseObjective& objective, const Refined& optimum, const Peak& peak,
                   double inflation) {
  const Scene& scene = objective.compiled().scene;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(peak.covariance);
  const LightSource light = light_near(objective.compiled(), optimum);
  const double top = tempered(optimum.value, inflation);
  const double expected = 0.5 * kSigmaPoint * kSigmaPoint;
  for (Eigen::Index i = 0; i < peak.center.size(); ++i) {
    const PoseVector step = kSigmaPoint * std::sqrt(std::max(eigen.eigenvalues()[i], 0.0)) *
                            eigen.eigenvectors().col(i);
    for (const double sign : {-1.0, 1.0}) {
      PoseVector pose = optimum.pose + sign * step;
      if (!std::isfinite(log_pose_prior(scene, pose))) return false;
      LinearSolution linear = optimum.linear;
      const PoseValue value = objective.evaluate(light, pose, linear, true);
      const double drop = top - tempered(value, inflation);
      if (drop > expected * kLaplaceFactor || drop < expected / kLaplaceFactor) return false;
    }
  }
  return true;
}

/// The spline where it agrees with the model about the peaks' shapes and differences, else the
/// model.
LightSource sample_light(const PoseObjective& objective, const std::vector<const Refined*>& optima,
                         const std::vector<Peak>& peaks, double inflation) {
  constexpr double kAgreement = 0.25;
  const CompiledScene& compiled = objective.compiled();
  if (!compiled.spline) return compiled.models();
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  const auto value = [&](const LightSource& light, const PoseVector& pose, LinearSolution linear) {
    return tempered(objective.evaluate(light, pose, linear, true, kAccuracy), inflation);
  };
  const auto note = [&](double difference) {
    low = std::min(low, difference);
    high = std::max(high, difference);
  };
  for (std::size_t j = 0; j < peaks.size() && high - low < kAgreement; ++j) {
    const Refined& top = *optima[j];
    note(value(*compiled.spline, top.pose, top.linear) - tempered(top.value, inflation));
    for (Eigen::Index i = 0; i < peaks[j].center.size(); ++i) {
      const PoseVector pose = top.pose + (i % 2 == 0 ? 1 : -1) * peaks[j].root.col(i);
      if (!std::isfinite(log_pose_prior(compiled.scene, pose))) continue;
      note(value(*compiled.spline, pose, top.linear) - value(compiled.models(), pose, top.linear));
    }
  }
  if (high - low < kAgreement) return *compiled.spline;
  return compiled.models();
}

void finish_mixture(const Scene& scene, PoseMixture& mixture) {
  double total = 0;
  for (const PoseMode& mode : mixture.modes) total += mode.weight;
  for (PoseMode& mode : mixture.modes) mode.weight /= total;
  std::stable_sort(mixture.modes.begin(), mixture.modes.end(),
                   [](const PoseMode& a, const PoseMode& b) { return a.weight > b.weight; });
  for (PoseMode& mode : mixture.modes) {
    mode.undetermined.clear();
    for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      if (mode.covariance(k, k) > kUndetermined * kUndetermined * prior_variance(scene, i)) {
        mode.undetermined.push_back(static_cast<int>(i));
      }
    }
  }
  set_moments(scene, mixture);
}

/// A way from one pose to another that nowhere falls below a level: the straight line, or one bent
/// along a curved ridge.
struct Ridge {
  std::function<double(const PoseVector&)> value;
  PoseVector spacing;  ///< [n] units in which directions are compared
  double least = 0;    ///< the level
  bool bend = true;

  /// Looks at the middle, moved uphill across the way if need be, then at both halves.
  bool leads(const PoseVector& from, const PoseVector& to, int halvings) const {
    PoseVector middle = 0.5 * (from + to);
    const double here = value(middle);
    if (here < least && !(bend && climb(middle, here, to - from))) return false;
    return halvings == 0 || (leads(from, middle, halvings - 1) && leads(middle, to, halvings - 1));
  }

 private:
  /// Compass search at right angles to the way, from a pose of value `best`, until the level is
  /// reached.
  bool climb(PoseVector& pose, double best, const PoseVector& way) const {
    const Eigen::Index n = pose.size();
    const PoseVector along = way.cwiseQuotient(spacing);
    // All columns but the first: at right angles to it.
    const Eigen::MatrixXd basis =
        along.householderQr().householderQ() * Eigen::MatrixXd::Identity(n, n);
    for (double step = 0.25; step > 0.03; step /= 2) {
      for (Eigen::Index i = 1; i < n; ++i) {
        for (const double sign : {1.0, -1.0}) {
          const PoseVector moved =
              pose + sign * step * along.norm() * basis.col(i).cwiseProduct(spacing);
          const double here = value(moved);
          if (here <= best) continue;
          best = here;
          pose = moved;
          if (best >= least) return true;
        }
      }
    }
    return false;
  }
};

/// The best samples at which least squares might end somewhere new.
std::vector<PoseVector> promising(const PoseObjective& objective, const LightSource& light,
                                  const std::vector<const Refined*>& optima,
                                  const std::vector<PosteriorSample>& samples) {
  constexpr std::size_t kMost = 3;
  const CompiledScene& compiled = objective.compiled();
  // The light may be the spline's: compare with what it says of the optima.
  double known = -std::numeric_limits<double>::infinity();
  std::vector<PoseVector> taken;
  for (const Refined* optimum : optima) {
    LinearSolution linear = optimum->linear;
    known = std::max(
        known, objective.evaluate(light, optimum->pose, linear, true, kAccuracy).log_posterior);
    taken.push_back(optimum->pose);
  }
  const double least = compiled.spline ? known + kBetter : known - kPromising;
  std::vector<const PosteriorSample*> order;
  for (const PosteriorSample& sample : samples) {
    if (sample.log_posterior > least) order.push_back(&sample);
  }
  std::stable_sort(order.begin(), order.end(),
                   [](auto* a, auto* b) { return a->log_posterior > b->log_posterior; });
  std::vector<PoseVector> result;
  for (const PosteriorSample* sample : order) {
    const bool apart = std::none_of(taken.begin(), taken.end(), [&](const PoseVector& other) {
      return (pose_difference(compiled.scene, other, sample->pose).array().abs() <
              compiled.spacing.array())
          .all();
    });
    if (!apart && sample->log_posterior < known + kBetter) continue;
    result.push_back(sample->pose);
    taken.push_back(sample->pose);
    if (result.size() == kMost) break;
  }
  return result;
}

}  // namespace

Information information(const PoseObjective& objective, const Refined& optimum,
                        const MovedModels* moved) {
  const CompiledScene& compiled = objective.compiled();
  const Observation& observation = objective.solver().observation();
  const LinearUnknowns& unknowns = objective.solver().unknowns();
  const int n = compiled.unknown_count();
  const int sensor = moved != nullptr ? 6 : 0;
  const bool shared = unknowns.amplitude == LinearMode::shared;
  const int global = n + sensor + (shared ? 1 : 0);

  // Derivatives of the unit-amplitude light in the pose and in the sensor's pose.
  const int rows = objective.rows();
  Eigen::MatrixXd gradient(rows, global);
  const LightSource source = light_near(compiled, optimum);
  ShapeBuffer at;
  objective.shapes(source, optimum.pose, at);
  ShapeBuffer plus;
  ShapeBuffer minus;
  const auto column = [&](int index, double width) {
    for (int r = 0; r < rows; ++r) {
      const auto k = static_cast<std::size_t>(r);
      gradient(r, index) = (plus.object[k] - minus.object[k]) / width;
    }
  };
  for (int i = 0; i < n; ++i) {
    PoseVector up = optimum.pose;
    PoseVector down = optimum.pose;
    up[i] += compiled.step[i];
    down[i] -= compiled.step[i];
    objective.shapes(source, up, plus);
    objective.shapes(source, down, minus);
    column(i, 2 * compiled.step[i]);
  }
  for (int i = 0; i < sensor; ++i) {
    const auto k = static_cast<std::size_t>(i);
    objective.shapes(moved->plus[k], optimum.pose, plus);
    objective.shapes(moved->minus[k], optimum.pose, minus);
    column(n + i, 2 * moved->step[k]);
  }

  Eigen::MatrixXd total = Eigen::MatrixXd::Zero(global, global);
  std::vector<double> mean;
  int row = 0;
  for (std::size_t z = 0; z < observation.zones.size(); ++z) {
    const ObservedZone& zone = observation.zones[z];
    const BinLikelihood& law = observation.law(zone);
    const double a = optimum.linear.amplitude[z];
    const double c = optimum.linear.ambient[z];
    const double b = optimum.linear.direct[z];
    mean.resize(zone.counts.size());
    objective.solver().expected(zone, at.shapes[z], a, c, b, mean.data());
    Eigen::MatrixXd cross = Eigen::MatrixXd::Zero(global, 3);
    Eigen::Matrix3d local = Eigen::Matrix3d::Zero();
    const OwnUnknowns own(unknowns, at.shapes[z]);
    Eigen::VectorXd g(global);
    for (int k = 0; k < zone.bins(); ++k, ++row) {
      const auto i = static_cast<std::size_t>(k);
      const double weight = law.information(std::max(mean[i], law.poisson() ? 1e-12 : -1e300));
      g.head(n + sensor) = a * gradient.row(row).head(n + sensor).transpose();
      const double light = a * at.shapes[z].object[k];
      if (shared) g[global - 1] = light;  // derivative in log a
      const Eigen::Vector3d l(own.amplitude ? light : 0, own.ambient ? 1 : 0,
                              own.direct ? at.shapes[z].direct[k] : 0);
      total.noalias() += weight * g * g.transpose();
      cross.noalias() += weight * g * l.transpose();
      local.noalias() += weight * l * l.transpose();
    }
    complete_own_information(zone, law, unknowns, own, c, local);
    total -= cross * local.ldlt().solve(cross.transpose());
  }
  if (shared) {
    total(global - 1, global - 1) += std::pow(unknowns.amplitude_prior.sigma_log, -2);
    const Eigen::VectorXd last = total.col(global - 1);
    total -= last * last.transpose() / last[global - 1];
  }
  Information info;
  info.pose = total.topLeftCorner(n, n);
  if (moved != nullptr) info.pose_sensor = total.block(0, n, n, 6);
  return info;
}

void set_moments(const Scene& scene, PoseMixture& mixture) {
  const PoseVector& reference = mixture.modes.front().pose;
  PoseVector shift = PoseVector::Zero(reference.size());
  for (const PoseMode& mode : mixture.modes) {
    shift += mode.weight * pose_difference(scene, reference, mode.pose);
  }
  mixture.covariance.setZero(reference.size(), reference.size());
  for (const PoseMode& mode : mixture.modes) {
    const PoseVector d = pose_difference(scene, reference, mode.pose) - shift;
    mixture.covariance += mode.weight * (mode.covariance + d * d.transpose());
  }
  mixture.mean = reference + shift;
  wrap_pose(scene, mixture.mean);
}

OwnUnknowns::OwnUnknowns(const LinearUnknowns& unknowns, const ZoneShapes& shapes)
    : amplitude(unknowns.amplitude == LinearMode::per_zone),
      ambient(unknowns.ambient == LinearMode::per_zone),
      direct(unknowns.direct == LinearMode::per_zone && shapes.direct != nullptr) {}

void complete_own_information(const ObservedZone& zone, const BinLikelihood& law,
                              const LinearUnknowns& unknowns, const OwnUnknowns& own,
                              double ambient, Eigen::Matrix3d& information) {
  if (own.ambient && zone.outside_bins > 0) {
    information(1, 1) += zone.outside_bins * law.information(std::max(ambient, 1e-12));
  }
  if (own.ambient && !unknowns.ambient_prior.empty()) {
    information(1, 1) +=
        std::pow(unknowns.ambient_prior[static_cast<std::size_t>(zone.zone)].sigma, -2);
  }
  if (own.amplitude) information(0, 0) += std::pow(unknowns.amplitude_prior.sigma_log, -2);
  for (int i = 0; i < 3; ++i) {
    double& own_term = information(i, i);
    own_term = own_term > 0 ? own_term * (1 + 1e-12) : 1.0;
  }
}

GoodnessOfFit goodness_of_fit(const PoseObjective& objective, const Refined& optimum) {
  const Observation& observation = objective.solver().observation();
  GoodnessOfFit fit;
  ShapeBuffer at;
  objective.shapes(light_near(objective.compiled(), optimum), optimum.pose, at);
  std::vector<double> mean;
  double variance = 0;
  const auto add = [&](const BinLikelihood& law, double m) {
    double e = 0;
    double v = 0;
    if (law.poisson()) {
      deviance_moments().at(std::max(law.scale() * m, 1e-12), e, v);
    } else {
      gaussian_deviance_moments(law, m, e, v);
    }
    fit.expected += e;
    variance += v;
  };
  for (std::size_t z = 0; z < observation.zones.size(); ++z) {
    const ObservedZone& zone = observation.zones[z];
    const BinLikelihood& law = observation.law(zone);
    mean.resize(zone.counts.size());
    objective.solver().expected(zone, at.shapes[z], optimum.linear.amplitude[z],
                                optimum.linear.ambient[z], optimum.linear.direct[z], mean.data());
    for (const double m : mean) add(law, m);
    if (law.poisson() && zone.outside_bins > 0)
      add(law, zone.outside_bins * optimum.linear.ambient[z]);
  }
  fit.deviance = -2 * optimum.value.log_likelihood;
  // Fitted unknowns take up about one unit of deviance each, where the data carries that much.
  const LinearUnknowns& unknowns = objective.solver().unknowns();
  double fitted = objective.compiled().unknown_count() + 1.0;
  const auto zones = static_cast<double>(observation.zones.size());
  if (unknowns.ambient == LinearMode::per_zone) fitted += zones;
  if (unknowns.direct == LinearMode::per_zone) fitted += zones;
  if (unknowns.amplitude == LinearMode::per_zone) fitted += zones - 1;
  fit.expected = std::max(fit.expected - fitted, 0.5 * fit.expected);
  fit.standard_deviation = std::sqrt(variance);
  const double excess = fit.deviance - fit.expected;
  fit.inflation = excess > 3 * fit.standard_deviation ? fit.deviance / fit.expected : 1.0;
  return fit;
}

std::vector<std::size_t> connect(const PoseObjective& objective,
                                 const std::vector<const Refined*>& optima, double inflation) {
  constexpr std::size_t kMostHeads = 6;
  const CompiledScene& compiled = objective.compiled();
  const LightSource light =
      compiled.spline ? LightSource(*compiled.spline) : LightSource(compiled.models());
  const auto value = [&](const PoseVector& pose, const LinearSolution& start) {
    if (!std::isfinite(log_pose_prior(compiled.scene, pose))) {
      return -std::numeric_limits<double>::infinity();
    }
    LinearSolution linear = start;
    return tempered(objective.evaluate(light, pose, linear, true, kAccuracy), inflation);
  };
  std::vector<double> ends;
  for (const Refined* optimum : optima) ends.push_back(value(optimum->pose, optimum->linear));
  const double top = ends.empty() ? 0.0 : *std::max_element(ends.begin(), ends.end());
  std::vector<std::size_t> head(optima.size());
  std::vector<std::size_t> heads;
  for (std::size_t j = 0; j < optima.size(); ++j) {
    head[j] = j;
    for (std::size_t h = 0; h < std::min(heads.size(), kMostHeads) && head[j] == j; ++h) {
      const Refined& best = *optima[heads[h]];
      Ridge ridge;
      ridge.spacing = compiled.spacing;
      ridge.least = std::min(ends[heads[h]], ends[j]) - kValley;
      ridge.bend = ends[j] > top - kWorthBending;
      ridge.value = [&](const PoseVector& pose) {
        PoseVector wrapped = pose;
        wrap_pose(compiled.scene, wrapped);
        return value(wrapped, best.linear);
      };
      const PoseVector way = pose_difference(compiled.scene, best.pose, optima[j]->pose);
      if (ridge.leads(best.pose, best.pose + way, kRidgeHalvings)) head[j] = heads[h];
    }
    if (head[j] == j) heads.push_back(j);
  }
  return head;
}

Posterior posterior(const PoseObjective& objective, const std::vector<Refined>& optima,
                    const Scored* scored, const MovedModels* moved,
                    const PosteriorOptions& options) {
  const Scene& scene = objective.compiled().scene;
  Posterior result;
  std::vector<Peak> peaks;
  std::vector<const Refined*> tops;
  std::vector<Eigen::MatrixXd> sensor_part;
  for (const Refined& optimum : optima) {
    Eigen::MatrixXd extra = Eigen::MatrixXd::Zero(optimum.pose.size(), optimum.pose.size());
    Peak peak = make_peak(objective, optimum, moved, options.inflation, &extra);
    // An optimum inside a better one's width is part of it.
    const bool inside = std::any_of(peaks.begin(), peaks.end(), [&](const Peak& other) {
      return mahalanobis2(scene, other, peak.center) < kMergeDistance * kMergeDistance;
    });
    if (inside) continue;
    peaks.push_back(std::move(peak));
    tops.push_back(&optimum);
    sensor_part.push_back(std::move(extra));
  }
  double best = -std::numeric_limits<double>::infinity();
  for (const Peak& peak : peaks) best = std::max(best, peak.log_evidence);
  const bool may_sample = scored != nullptr && options.samples > 0;
  bool laplace = true;
  for (std::size_t j = 0; may_sample && j < peaks.size() && laplace; ++j) {
    if (peaks[j].log_evidence < best - 7) continue;
    laplace = laplace_holds(objective, *tops[j], peaks[j], options.inflation);
  }

  const auto add_mode = [&](std::size_t j, double weight, const PoseVector& mean,
                            const Eigen::MatrixXd& covariance) {
    PoseMode mode;
    mode.weight = weight;
    mode.pose = mean;
    mode.covariance = covariance + sensor_part[j];
    mode.log_likelihood = tops[j]->value.log_likelihood;
    mode.optimum = tops[j]->pose;
    result.mixture.modes.push_back(std::move(mode));
  };

  PosteriorSamples drawn;
  if (may_sample && !laplace) {
    const LightSource light = sample_light(objective, tops, peaks, options.inflation);
    drawn = sample_posterior(objective, light, peaks, tops, *scored,
                             {options.samples, options.inflation, options.seed});
    result.promising = promising(objective, light, tops, drawn.samples);
  }
  if (!(drawn.effective > 1)) {
    double sum = 0;
    for (const Peak& peak : peaks) sum += std::exp(peak.log_evidence - best);
    result.log_evidence = best + std::log(sum);
    for (std::size_t j = 0; j < peaks.size(); ++j) {
      const double weight = std::exp(peaks[j].log_evidence - best) / sum;
      if (j == 0 || weight > std::exp(-options.negligible)) {
        add_mode(j, weight, peaks[j].center, peaks[j].covariance);
      }
    }
    finish_mixture(scene, result.mixture);
    return result;
  }

  result.sampled = true;
  result.effective_samples = drawn.effective;
  result.log_evidence = drawn.log_evidence;
  const std::vector<std::size_t> head = connect(objective, tops, options.inflation);
  for (std::size_t j = 0; j < peaks.size(); ++j) {
    if (head[j] != j) continue;
    std::vector<const PosteriorSample*> own;
    double weight = 0;
    double squares = 0;
    for (const PosteriorSample& sample : drawn.samples) {
      if (head[sample.peak] != j || sample.weight <= 0) continue;
      own.push_back(&sample);
      weight += sample.weight;
      squares += sample.weight * sample.weight;
    }
    if (weight <= 0) continue;
    PoseVector mean = peaks[j].center;
    Eigen::MatrixXd covariance = peaks[j].covariance;
    // Moments need several samples per dimension; with fewer the Laplace shape is kept.
    if (weight * weight / squares > 2.0 * static_cast<double>(mean.size())) {
      moments(scene, own, peaks[j].center, mean, covariance);
      covariance += 1e-4 * peaks[j].covariance;
    }
    if (weight > std::exp(-options.negligible)) add_mode(j, weight, mean, covariance);
  }
  finish_mixture(scene, result.mixture);
  return result;
}

}  // namespace blindcorner
