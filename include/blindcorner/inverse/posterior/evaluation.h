// SPDX-License-Identifier: Apache-2.0
/// How good estimates are, and how honest about it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

namespace blindcorner {

/// One estimate against the truth, lengths in metres and angles in radians.
struct EstimateError {
  Eigen::VectorXd error;       ///< [unknowns] estimate minus truth
  Eigen::MatrixXd covariance;  ///< as the estimate claims it
  /// Estimates of the same position: the bootstrap draws them together.
  std::string group;
};

struct EvaluationOptions {
  /// Of the bootstrap over groups: fifty beyond either end of the interval, whose share is thereby
  /// known to a seventh.
  int resamples = 2000;
  double interval = 0.95;  ///< share of the resamples that the intervals hold, by convention
  std::uint64_t seed = 1;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// A figure with its bootstrap interval.
struct Figure {
  std::string name;
  double value = 0;
  double low = 0, high = 0;
};

struct Evaluation {
  int estimates = 0;
  int groups = 0;
  /// In this order: `rmse_<unknown>` of each; where there are coordinates of position, `rmse_m`
  /// over all of them, `median_distance_m` and `p90_distance_m` (Euclidean); of each other unknown
  /// `median_<unknown>` and `p90_<unknown>` of its absolute error; `coverage_1sigma` and
  /// `coverage_2sigma` (share of unknowns; 0.683 and 0.954 when honest), `normalised_error` (mean
  /// of e' C^-1 e / unknowns; 1 when honest).
  std::vector<Figure> figures;

  /// Throws Error for a name that is not there.
  const Figure& figure(const std::string& name) const;
};

/// Whether an unknown of this name is a coordinate of position: "x_m".
bool is_position(const std::string& unknown);

/// Length of an error over the coordinates of position, m.
double distance_of(const Eigen::VectorXd& error, const std::vector<std::string>& names);

/// `names` are the unknowns' names. Throws Error without estimates, or when a covariance is not
/// positive definite.
Evaluation evaluate_errors(const std::vector<EstimateError>& errors,
                           const std::vector<std::string>& names,
                           const EvaluationOptions& options = {});

}  // namespace blindcorner
