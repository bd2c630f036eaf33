// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/answer.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "blindcorner/forward/constants.h"
#include "inverse/posterior/detection.h"
#include "inverse/posterior/prior_moments.h"
#include "inverse/posterior/unexplained_light.h"

namespace blindcorner {
namespace {

/// Probability of presence below which the light says nothing about it: one half, and a margin for
/// the rounding of evidences.
constexpr double kNoEvidence = 0.51;
/// Number of effective samples below which a flag is set: 20 give a variance to sqrt(2 / 20) =
/// 32 %.
constexpr double kFewEffective = 20;

}  // namespace

bool no_photons(const Observation& observation) {
  return observation.likelihood.front()->counts_photons() && observation.total_count() <= 0;
}

void answer_darkness(const CompiledScene& compiled, const Observation& observation,
                     std::span<const Capture> captures, FitResult& result) {
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
  for (const Capture& capture : captures) {
    FittedHistograms unlit;
    unlit.measured = capture.counts;
    unlit.model = unlit.object =
        HistogramCube(capture.counts.rows, capture.counts.columns, capture.counts.bins);
    unlit.zone_used.assign(static_cast<std::size_t>(capture.counts.zones()), true);
    unlit.ambient = unlit.direct = unlit.amplitude =
        std::vector<double>(unlit.zone_used.size(), 0.0);
    unlit.end_bin = capture.counts.bins;
    result.histograms.push_back(std::move(unlit));
  }
}

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

}  // namespace blindcorner
