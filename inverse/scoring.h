// SPDX-License-Identifier: Apache-2.0
/// Exhaustive scoring of precomputed poses: a matched filter for all, the likelihood for the best.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "pose_objective.h"

namespace blindcorner {

/// Score statistic of every pose against the empty scene: the gain in log likelihood that a
/// quadratic expansion about the empty fit promises, with the ambient light and the direct return
/// projected out. Computed for many realisations of the counts at once.
class MatchedFilter {
 public:
  enum class Weights {
    expected,  ///< variances of the empty fit: the score test, for detection
    observed   ///< variances of the smoothed counts where these are larger: for bright objects
  };

  MatchedFilter(const PoseObjective& objective, const LinearSolution& empty, Weights weights);

  /// Score of each pose (>= 0) for the observation's own counts.
  Eigen::VectorXf scores() const;

  /// Largest score over all poses for each column of `counts` [rows, realisations].
  Eigen::VectorXf largest_scores(const Eigen::MatrixXf& counts) const;

  /// Mean counts of the empty fit, [rows].
  const Eigen::VectorXf& mean() const { return mean_; }
  /// The observation's counts, [rows].
  const Eigen::VectorXf& counts() const { return counts_; }

 private:
  Eigen::MatrixXf scores_of(const Eigen::MatrixXf& counts) const;

  const PoseObjective& objective_;
  Eigen::VectorXf mean_, counts_, weight_;
  Eigen::MatrixXf basis_;        // [rows, 2] orthonormal nuisance directions within each zone
  std::vector<int> zone_begin_;  // [zones + 1]
};

/// A pose worth refining.
struct Candidate {
  int index = 0;             ///< into CompiledScene::poses
  double log_posterior = 0;  ///< of the template
};

/// What exhaustive scoring found.
struct Scored {
  Eigen::VectorXf scores;         ///< of the matched filter with observed weights, [poses]
  double empty = 0;               ///< log posterior without an object
  std::vector<Candidate> exact;   ///< the matched filter's best poses with their log posterior
  std::vector<Candidate> starts;  ///< separated ones among them, worth refining
};

/// Scores all poses with the matched filter (faint objects with both weights) and its best ones
/// exactly, both lists best first. At most `count` starts, none next to a better one on the grid.
Scored score(const PoseObjective& objective, const LinearSolution& empty, int count,
             double negligible);

}  // namespace blindcorner
