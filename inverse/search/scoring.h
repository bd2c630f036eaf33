// SPDX-License-Identifier: Apache-2.0
/// Exhaustive scoring of precomputed poses. A matched filter scores all of them, the likelihood the
/// best ones.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "inverse/likelihood/pose_objective.h"

namespace blindcorner {

/// Gain of each pose at a shared amplitude a: a * projection - a^2 * norm / 2.
struct GainOfAmplitude {
  Eigen::VectorXf projection, norm;  ///< [poses]
};

/// Log posterior of each pose at its amplitude's mode, up to the prior's constant.
Eigen::VectorXf gain_under_prior(const GainOfAmplitude& gains, const AmplitudePrior& prior);

/// Score statistic of every pose against the empty scene: the gain that a quadratic expansion about
/// the empty fit promises, with the ambient light and the direct return projected out. Computed for
/// many realisations of the counts at once.
class MatchedFilter {
 public:
  enum class Weights {
    expected,  ///< variances of the empty fit: the score test, for detection
    observed   ///< variances of the smoothed counts where these are larger: for bright objects
  };
  enum class Priors {
    ignored,  ///< of brightness and ambient light: for detection
    used      ///< to find where the posterior lies
  };

  MatchedFilter(const PoseObjective& objective, const LinearSolution& empty, Weights weights,
                Priors priors);

  /// Score of each pose for the observation's own counts: the gain in log likelihood (>= 0). With
  /// priors, it is the gain in log posterior without the pose's prior and without the constant of
  /// the shared amplitude's prior.
  Eigen::VectorXf scores() const;

  /// The same for other templates and other counts [rows].
  Eigen::VectorXf scores(const Templates& templates, const Eigen::VectorXf& counts) const;

  /// Largest gain in log likelihood over all poses for each column of `counts`
  /// [rows, realisations].
  Eigen::VectorXf largest_scores(const Eigen::MatrixXf& counts) const;

  /// Mean counts of the empty fit, [rows].
  const Eigen::VectorXf& mean() const { return mean_; }
  /// The observation's counts, [rows].
  const Eigen::VectorXf& counts() const { return counts_; }

 private:
  /// Gain of each pose at its best amplitude, for each realisation. `gains`, unless null, receives
  /// the first realisation's gain as a function of the amplitude.
  Eigen::MatrixXf scores_of(const Templates& templates, const Eigen::MatrixXf& counts,
                            GainOfAmplitude* gains = nullptr) const;

  const PoseObjective& objective_;
  Priors priors_;
  Eigen::VectorXf mean_, counts_, weight_;
  Eigen::MatrixXf basis_;        // [rows, 2] orthonormal nuisance directions within each zone
  Eigen::MatrixXf pull_;         // [zones, 2] pull along them by priors and bins outside the gate
  std::vector<int> zone_begin_;  // [zones + 1]
};

/// A pose worth refining.
struct Candidate {
  int index = 0;             ///< into CompiledScene::poses; -1: not one of these
  double log_posterior = 0;  ///< of the template
  PoseVector pose;
};

/// What exhaustive scoring found.
struct Scored {
  /// [poses] log posterior above `empty` that the filter with observed weights promises.
  Eigen::VectorXf scores;
  /// Log posterior without an object. It includes the value of each amplitude's prior at its mode.
  double empty = 0;
  std::vector<Candidate> exact;   ///< the matched filter's best poses with their log posterior
  std::vector<Candidate> starts;  ///< separated ones among them, worth refining
};

/// Places of several objects together that are worth refining. One object's place is found alone,
/// the next one's from what is left of the counts, and the first one's again from what the others
/// leave. Best first, at most `count`.
std::vector<Candidate> object_starts(const PoseObjective& objective, const LinearSolution& empty,
                                     std::size_t count);

/// Poses in which one of several objects is elsewhere on its grid and the others are as in
/// `optimum`. They are the `most` best places of each object that are no neighbours of a better
/// one. The light is in closed form, corrected at the optimum, with the objects' shadows on each
/// other.
std::vector<PoseVector> other_places(const PoseObjective& objective, const PoseVector& optimum,
                                     const LinearSolution& linear, std::size_t most);

/// Scores all poses with the matched filter (faint objects with both weights) and the filter's best
/// poses exactly. Both lists are best first. At most `count` poses of the grid become starts, none
/// next to a better start. With several objects, object_starts() come before them.
Scored score(const PoseObjective& objective, const LinearSolution& empty, int count,
             double negligible);

/// The best poses by the model's own light that are no neighbours, at most `count`. They are chosen
/// from the starts and, with one object, from the best of the poses that were scored exactly.
std::vector<PoseVector> best_by_model(const PoseObjective& objective, const Scored& scored,
                                      std::size_t count);

}  // namespace blindcorner
