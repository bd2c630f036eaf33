// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/posterior.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "blindcorner/forward/constants.h"
#include "forward/support/parallel.h"
#include "inverse/posterior/along_axis.h"
#include "inverse/posterior/importance.h"
#include "inverse/posterior/mode_merging.h"
#include "inverse/posterior/prior_moments.h"
#include "inverse/posterior/ridge.h"

namespace blindcorner {
namespace {

/// An unknown is called undetermined when its posterior keeps more than this share of the prior's
/// width: less than a third of a bit was learned about it (log2 of 0.8 is -0.32).
constexpr double kUndetermined = 0.8;
/// Ratio of a fall to the Gaussian's (FallRatios) above which a ridge is taken to bend. It is 3 to
/// 25 for a plate over an oblique floor (10,000 photons) where samples missed half of the ridge. In
/// some twenty frames of the street and of both TMF8828 scenes it is at most 1.9.
constexpr double kBent = 2;
/// A mode with less than exp(-7) = 0.1 % of the evidence need not follow Laplace.
constexpr double kMinorEvidence = 7.0;

Peak make_peak(const PoseObjective& objective, const Refined& optimum, const MovedModels* moved,
               double inflation, Eigen::MatrixXd* sensor_covariance) {
  const Scene& scene = objective.compiled().scene;
  const bool moves = moved != nullptr && sensor_covariance != nullptr && scene.sensor_covariance;
  const PoseInformation info =
      pose_information(objective, optimum,
                       moves ? sensor_slope(objective, *moved, optimum.pose) : Eigen::MatrixXd());
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
  if (moves) {
    // The optimum moves by -I_tt^-1 I_ts ds when the sensor is not where it was said to be.
    const Eigen::MatrixXd gain = peak.covariance * info.disturbance / inflation;
    *sensor_covariance = gain * *scene.sensor_covariance * gain.transpose();
  }
  return peak;
}

/// Fall of the log posterior along each principal axis of a peak, divided by that of the peak's
/// Gaussian, at the points of kAway. NaN outside the prior.
struct AxisFalls {
  Eigen::MatrixXd axes;            ///< [n, n] one standard deviation each, as columns
  std::vector<FallRatios> ratios;  ///< [n]
  /// Whether the falls agree with the Gaussian's. The far points are evaluated only if the near
  /// ones agree.
  bool gaussian = false;

  /// Whether the posterior bends away from the Gaussian's axes: it then falls faster along them.
  bool bent() const {
    return std::ranges::any_of(ratios, [](const auto& of_axis) {
      return std::ranges::any_of(of_axis, [](double ratio) { return ratio > kBent; });
    });
  }
};

AxisFalls axis_falls(const PoseObjective& objective, const Refined& optimum, const Peak& peak,
                     double inflation) {
  const Scene& scene = objective.compiled().scene;
  AxisFalls falls;
  falls.axes = principal_deviations(peak.covariance);
  falls.ratios.resize(static_cast<std::size_t>(peak.center.size()));
  for (auto& of_axis : falls.ratios) of_axis.fill(std::numeric_limits<double>::quiet_NaN());
  const LightSource light = light_near(objective, optimum);
  const double top = tempered(optimum.value, inflation);
  const auto look = [&](std::size_t axis, std::size_t k) {
    const double away = kAway[k];
    const PoseVector pose = optimum.pose + away * falls.axes.col(static_cast<Eigen::Index>(axis));
    if (!std::isfinite(log_pose_prior(scene, pose))) return;
    LinearSolution linear = optimum.linear;
    const PoseValue value = objective.evaluate(light, pose, linear, true);
    falls.ratios[axis][k] = (top - tempered(value, inflation)) / (0.5 * away * away);
  };
  const auto look_at = [&](double distance) {
    parallel_for(std::size_t{0}, falls.ratios.size() * std::size(kAway), [&](std::size_t i) {
      const std::size_t k = i % std::size(kAway);
      if (std::abs(kAway[k]) == distance) look(i / std::size(kAway), k);
    });
  };
  look_at(kSigmaPoint);
  falls.gaussian = std::ranges::all_of(falls.ratios, falls_like_gaussian);
  if (!falls.gaussian) return falls;
  look_at(kTailPoint);
  for (auto& of_axis : falls.ratios) {
    for (double& ratio : of_axis) {
      if (std::isnan(ratio)) ratio = 1;  // a bound there takes less than a hundredth away
      falls.gaussian = falls.gaussian && ratio >= 1 / kLaplaceFactor;
    }
  }
  return falls;
}

/// The peak with the moments and the evidence of a posterior that is the product of its measured
/// falls along the principal axes. What bends away from the axes is not seen in this way. The root
/// and the determinant stay those of the Gaussian.
Peak corrected_laplace(const Scene& scene, const Refined& optimum, const Peak& peak,
                       const AxisFalls& falls) {
  Peak corrected = peak;
  corrected.center = optimum.pose;
  corrected.covariance.setZero();
  for (std::size_t i = 0; i < falls.ratios.size(); ++i) {
    const Eigen::VectorXd sigma = falls.axes.col(static_cast<Eigen::Index>(i));
    const AlongAxis along = integrate_along(falls.ratios[i]);
    corrected.center += along.mean * sigma;
    corrected.covariance += along.variance * sigma * sigma.transpose();
    corrected.log_evidence += std::log(along.mass);
  }
  wrap_pose(scene, corrected.center);
  return corrected;
}

double best_evidence(const std::vector<Peak>& peaks) {
  double best = -std::numeric_limits<double>::infinity();
  for (const Peak& peak : peaks) best = std::max(best, peak.log_evidence);
  return best;
}

/// Light with which samples about each peak are evaluated. It is the light of the rough models,
/// corrected at the peak to that of the better models. The spline is used instead where it agrees
/// with that light about the peaks' shapes and their differences in height. Closed-form light,
/// which leads descents, would be a third of the work, but it sees only one end of curved ridges.
/// Where it agreed within half a log unit at one standard deviation, a fifth of the posteriors of
/// an oblique floor at 100,000 photons lacked the truth by up to six of their standard deviations.
SampleLights sample_lights(const PoseObjective& objective,
                           const std::vector<const Refined*>& optima,
                           const std::vector<Peak>& peaks, double inflation) {
  // What a Gaussian's logarithm falls by within one standard deviation of its peak, and the
  // distance at which it has fallen by 12.5, about as far as what is negligible.
  constexpr double kAgreement = 0.5;
  constexpr double kReach = 5;
  const CompiledScene& compiled = objective.compiled();
  SampleLights lights{{}, {}, kReach, objective.rough_models()};
  lights.corrections.resize(optima.size());
  parallel_for(std::size_t{0}, optima.size(), [&](std::size_t j) {
    const PoseVector& pose = optima[j]->pose;
    ShapeBuffer right;
    ShapeBuffer rough;
    objective.shapes(light_near(objective, *optima[j]), pose, right);
    objective.shapes(objective.rough_models(), pose, rough);
    lights.corrections[j] = objective.correction(right, rough);
  });
  lights.far = lights.far.asked_once();
  for (const Correction& correction : lights.corrections) {
    lights.near.push_back(lights.far.corrected(correction));
  }
  if (!compiled.spline) return lights;
  const LightSource spline(*compiled.spline);
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (std::size_t j = 0; j < peaks.size(); ++j) {
    const auto value = [&](const LightSource& light, const PoseVector& pose) {
      LinearSolution linear = optima[j]->linear;
      return tempered(objective.evaluate(light, pose, linear, true, kSampleAccuracy), inflation);
    };
    std::vector<PoseVector> places{optima[j]->pose};
    for (Eigen::Index i = 0; i < peaks[j].center.size(); ++i) {
      places.push_back(places.front() + (i % 2 == 0 ? 1 : -1) * peaks[j].root.col(i));
    }
    for (const PoseVector& pose : places) {
      if (!std::isfinite(log_pose_prior(compiled.scene, pose))) continue;
      const double difference = value(spline, pose) - value(lights.near[j], pose);
      low = std::min(low, difference);
      high = std::max(high, difference);
    }
    if (high - low > kAgreement) return lights;
  }
  lights.near.assign(optima.size(), spline);
  lights.far = spline;
  return lights;
}

/// Components along the ridges of the peaks that bend. The peaks are followed in parallel.
std::vector<Peak> all_ridges(const PoseObjective& objective, const SampleLights& lights,
                             const std::vector<const Refined*>& optima,
                             const std::vector<Peak>& peaks, const std::vector<bool>& bent,
                             double inflation) {
  const Scene& scene = objective.compiled().scene;
  std::vector<std::vector<Peak>> found(peaks.size());
  parallel_for(std::size_t{0}, peaks.size(), [&](std::size_t j) {
    if (!bent[j]) return;
    found[j] = ridge_components(scene, peaks[j], [&](PoseVector pose) {
      wrap_pose(scene, pose);
      if (!std::isfinite(log_pose_prior(scene, pose))) {
        return -std::numeric_limits<double>::infinity();
      }
      const bool near = mahalanobis2(scene, peaks[j], pose) < lights.reach * lights.reach;
      LinearSolution linear = optima[j]->linear;
      return tempered(objective.evaluate(near ? lights.near[j] : lights.far, pose, linear, true,
                                         kSampleAccuracy),
                      inflation);
    });
  });
  std::vector<Peak> ridges;
  for (std::vector<Peak>& of_one : found) {
    std::ranges::move(of_one, std::back_inserter(ridges));
  }
  return ridges;
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
      if (mode.covariance(k, k) >
          kUndetermined * kUndetermined * prior_moments(scene, i).variance) {
        mode.undetermined.push_back(static_cast<int>(i));
      }
    }
  }
  set_moments(scene, mixture);
}

}  // namespace

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
    if (within_better(scene, peaks, peak.center)) continue;
    peaks.push_back(std::move(peak));
    tops.push_back(&optimum);
    sensor_part.push_back(std::move(extra));
  }
  double best = best_evidence(peaks);
  const bool may_sample = scored != nullptr && options.samples > 0;
  bool laplace = true;
  std::vector<Peak> corrected = peaks;
  std::vector<bool> bent(peaks.size(), false);
  for (std::size_t j = 0; may_sample && j < peaks.size(); ++j) {
    if (peaks[j].log_evidence < best - kMinorEvidence) continue;
    const AxisFalls falls = axis_falls(objective, *tops[j], peaks[j], options.inflation);
    bent[j] = falls.bent();
    laplace = laplace && falls.gaussian;
    if (falls.gaussian && options.along_axis)
      corrected[j] = corrected_laplace(scene, *tops[j], peaks[j], falls);
  }

  const auto add_mode = [&](std::size_t j, double weight, const PoseVector& mean,
                            const Eigen::MatrixXd& covariance) {
    PoseMode mode;
    mode.weight = weight;
    mode.pose = mean;
    mode.covariance = covariance + sensor_part[j];
    if (options.model_error.size() > 0) mode.covariance += options.model_error;
    mode.log_likelihood = tops[j]->value.log_likelihood;
    mode.optimum = tops[j]->pose;
    result.mixture.modes.push_back(std::move(mode));
  };

  PosteriorSamples drawn;
  if (may_sample && !laplace) {
    const SampleLights lights = sample_lights(objective, tops, peaks, options.inflation);
    std::vector<Peak> ridges;
    if (options.ridges)
      ridges = all_ridges(objective, lights, tops, peaks, bent, options.inflation);
    drawn =
        sample_posterior(objective, lights, peaks, ridges, tops, *scored,
                         {options.samples, options.inflation, options.seed, options.local_light});
  }
  if (!(drawn.effective > 1)) {
    if (laplace) peaks = std::move(corrected);
    double sum = 0;
    best = best_evidence(peaks);
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
    const double effective = weight * weight / squares;
    const auto n = static_cast<double>(mean.size());
    if (effective > 2 * (n + 2)) {
      moments(scene, own, peaks[j].center, mean, covariance);
      // The squared error of the samples' mean is 1 / N of the covariance. The samples' covariance
      // is a Wishart matrix of N - 1 degrees of freedom over N, and its inverse is too large by N
      // / (N - n - 2) on average.
      covariance *= (effective + 1) / (effective - n - 2);
      // Even coinciding samples leave a per cent of Laplace's width.
      covariance += 1e-4 * peaks[j].covariance;
    }
    if (weight > std::exp(-options.negligible)) add_mode(j, weight, mean, covariance);
  }
  finish_mixture(scene, result.mixture);
  return result;
}

}  // namespace blindcorner
