// SPDX-License-Identifier: Apache-2.0
/// Importance sampling of the pose's posterior, for where a Gaussian does not describe it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "inverse/search/refine.h"
#include "inverse/search/scoring.h"

namespace blindcorner {

/// Accuracy of the log posterior at optima, on the ways between them and along their ridges.
/// Densities there are right to a thousandth, far better than 256 samples can tell.
constexpr double kSampleAccuracy = 1e-3;

/// A mode of the posterior before its weight is known.
struct Peak {
  PoseVector center;
  Eigen::MatrixXd covariance;
  Eigen::MatrixXd root;     ///< Cholesky factor
  double log_det = 0;       ///< of the covariance
  double log_evidence = 0;  ///< Laplace
};

/// A pose's difference from a peak in uncorrelated coordinates, in standard deviations.
PoseVector whitened(const Scene& scene, const Peak& peak, const PoseVector& pose);

/// Squared distance of a pose from a peak in units of its covariance.
double mahalanobis2(const Scene& scene, const Peak& peak, const PoseVector& pose);

/// Log posterior integrand with the likelihood tempered by the inflation.
double tempered(const PoseValue& value, double inflation);

struct PosteriorSample {
  PoseVector pose;
  double log_target = 0;  ///< tempered log integrand; -infinity outside of the prior
  double log_posterior = 0;
  double weight = 0;     ///< sum to one
  std::size_t peak = 0;  ///< nearest one
};

struct PosteriorSamples {
  std::vector<PosteriorSample> samples;
  double log_evidence = 0;
  double effective = 0;  ///< (sum w)^2 / sum w^2
};

/// Weighted mean and covariance of samples. Differences are taken from `reference`, circular where
/// the unknown is.
void moments(const Scene& scene, const std::vector<const PosteriorSample*>& samples,
             const PoseVector& reference, PoseVector& mean, Eigen::MatrixXd& covariance);

/// Light that samples are evaluated with.
struct SampleLights {
  std::vector<LightSource> near;        ///< [peaks] about each peak
  std::vector<Correction> corrections;  ///< [peaks] that `near` uses
  double reach = 0;                     ///< standard deviations about a peak where `near` holds
  LightSource far;                      ///< elsewhere
};

struct SamplingOptions {
  /// Number of samples, enough when they are worth a quarter as many independent ones (a third
  /// where the light is a spline).
  int samples = 256;
  double inflation = 1.0;
  std::uint64_t seed = 1;
  bool local_light = true;  ///< evaluate a polynomial of the light where it is good enough
};

/// Samples the posterior in stages. The proposal is a mixture of Student t about the peaks and
/// along their ridges (`ridges`, also peaks) and of the scored grid's cells. Each cell is drawn
/// about as often as the filter's score says that the posterior lives there. The points are those
/// of a sequence that fills space evenly. After each stage the mixture gets two more Student t, one
/// with the samples' own moments and one about the heaviest sample (incremental mixture importance
/// sampling), and its shares are adapted (population Monte Carlo). All samples are weighted by the
/// density of the whole mixture, so that every stage counts. Sampling stops when enough samples are
/// effective and their moments have settled, at the latest after four times as many as asked for.
PosteriorSamples sample_posterior(const PoseObjective& objective, const SampleLights& lights,
                                  const std::vector<Peak>& peaks, const std::vector<Peak>& ridges,
                                  const std::vector<const Refined*>& optima, const Scored& scored,
                                  const SamplingOptions& options);

}  // namespace blindcorner
