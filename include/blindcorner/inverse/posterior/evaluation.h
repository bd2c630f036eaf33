// SPDX-License-Identifier: Apache-2.0
/// Accuracy of estimates, and honesty of their stated uncertainties.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

namespace blindcorner {

/// One estimate against the truth; lengths in metres and angles in radians.
struct EstimateError {
  Eigen::VectorXd error;       ///< [unknowns] estimate minus truth
  Eigen::MatrixXd covariance;  ///< as stated by the estimate
  /// Estimates of the same position form a group, which the bootstrap draws together.
  std::string group;
};

struct EvaluationOptions {
  /// Resamples of the bootstrap over groups. Fifty lie beyond either end of the interval, so that
  /// the share beyond an end is known to a seventh.
  int resamples = 2000;
  double interval = 0.95;  ///< share of the resamples within the intervals, by convention
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
  /// In this order: `rmse_<unknown>` of each unknown; where there are coordinates of position,
  /// `rmse_m` over all of them, `median_distance_m` and `p90_distance_m` (Euclidean); for each
  /// other unknown, `median_<unknown>` and `p90_<unknown>` of its absolute error; `coverage_1sigma`
  /// and `coverage_2sigma` (share of unknowns; 0.683 and 0.954 when honest); `normalised_error`
  /// (mean of e' C^-1 e / unknowns; 1 when honest).
  std::vector<Figure> figures;

  /// The figure of this name. Throws Error for a name that is not there.
  const Figure& figure(const std::string& name) const;
};

/// Whether an unknown of this name is a coordinate of position, such as "x_m".
bool is_position(const std::string& unknown);

/// Length of an error over the coordinates of position, m.
double distance_of(const Eigen::VectorXd& error, const std::vector<std::string>& names);

/// Evaluates the errors of estimates. `names` are the unknowns' names. Throws Error without
/// estimates, or when a covariance is not positive definite.
Evaluation evaluate_errors(const std::vector<EstimateError>& errors,
                           const std::vector<std::string>& names,
                           const EvaluationOptions& options = {});

}  // namespace blindcorner
