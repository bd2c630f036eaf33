// SPDX-License-Identifier: Apache-2.0
/// Light that a fit leaves unexplained and that objects could have sent.
#pragma once

#include <Eigen/Core>
#include <string>

#include "inverse/search/refine.h"

namespace blindcorner {

/// Score tests of what a fit may have got wrong. The deviance's sum over all bins drowns a few
/// photons in the wrong place in the noise of all the bins that they do not reach; a score test
/// looks only where a given change would show.
///
/// Let light t_q of some directions q be added to what is expected, with random brightness of mean
/// 0 and a small variance, the same for all in units of what each can be told to (1/I_qq below).
/// The locally most powerful test of that variance against 0 is the sum of the squared scores of
/// the t_q (Goeman, van de Geer and van Houwelingen 2006, "Testing against a high dimensional
/// alternative"). With pose, brightness and the zones' own linear unknowns fitted, the efficient
/// scores g of the t_q have, where the model is right, covariance I: Fisher information of the t_q
/// less what the fitted unknowns take up. With R the correlation matrix of I, the sum over q of
/// g_q^2 / I_qq then has the mean K and the variance 2 |R|^2, and is close to a multiple of a
/// chi-square that has these (Satterthwaite).
struct ScoreTest {
  double probability = 1;  ///< of a sum so large where the model is right
  double freedom = 0;      ///< degrees of that chi-square; 0: nothing to look at
};

/// From scores and their covariance; `spread` [K] are factors on the scores' variances for what
/// else than photon noise may be off, at least 1.
ScoreTest score_test(const Eigen::VectorXd& score, const Eigen::MatrixXd& information,
                     const Eigen::VectorXd& spread);

/// A probability that comes about once in two hundred captures of a right model: flagged below. By
/// judgement: every capture is tested, so it has to be rarer than a false alarm.
inline constexpr double kUnexplained = 0.005;

struct UnexplainedLight {
  ScoreTest elsewhere;  ///< directions: light of objects at places all over the search region
  ScoreTest size;       ///< directions: what larger objects of the stated shapes would add

  /// Of either being so unlikely where the model is right (Bonferroni's, at most 1).
  double probability() const;
};

UnexplainedLight unexplained_light(const PoseObjective& objective, const Refined& optimum);

/// What it means and what to do about it, in a sentence.
std::string unexplained_hint(double probability);

}  // namespace blindcorner
