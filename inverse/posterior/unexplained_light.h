// SPDX-License-Identifier: Apache-2.0
/// Light that a fit leaves unexplained and that objects could have sent.
#pragma once

#include <Eigen/Core>
#include <string>

#include "inverse/search/refine.h"

namespace blindcorner {

/// Score tests of what a fit may have got wrong. In the deviance's sum over all bins, a few photons
/// in the wrong place drown in the noise of all the bins that they do not reach. A score test looks
/// only where a given change would show.
///
/// Let light t_q of K directions q be added to the expected light, with random brightness of mean 0
/// and a small variance, which is the same for all directions in units of the variance to which
/// each brightness can be measured (1/I_qq below). The locally most powerful test of that variance
/// against 0 is the sum of the squared scores of the t_q (Goeman, van de Geer and van Houwelingen
/// 2006, "Testing against a high dimensional alternative"). The pose, the brightness and the zones'
/// own linear unknowns are fitted. If the model is right, the efficient scores g of the t_q then
/// have a covariance I: the Fisher information of the t_q less what the fitted unknowns take up.
/// With R the correlation matrix of I, the sum over q of g_q^2 / I_qq has the mean K and the
/// variance 2 |R|^2. It is close to a multiple of a chi-square with these moments (Satterthwaite).
struct ScoreTest {
  double probability = 1;  ///< of a sum at least this large if the model is right
  double freedom = 0;      ///< degrees of freedom of that chi-square; 0: nothing to look at
};

/// Tests scores whose covariance is `information`. `spread` [K] holds factors, at least 1, on the
/// scores' variances for errors other than photon noise.
ScoreTest score_test(const Eigen::VectorXd& score, const Eigen::MatrixXd& information,
                     const Eigen::VectorXd& spread);

/// Probability below which light is flagged as unexplained: once in two hundred captures of a right
/// model. By judgement: every capture is tested, so the flag has to be rarer than a false alarm.
inline constexpr double kUnexplained = 0.005;

struct UnexplainedLight {
  ScoreTest elsewhere;  ///< directions: light of objects at places all over the search region
  ScoreTest size;       ///< directions: what larger objects of the stated shapes would add

  /// Probability that either test is so unlikely if the model is right (Bonferroni's bound, at most
  /// 1).
  double probability() const;
};

UnexplainedLight unexplained_light(const PoseObjective& objective, const Refined& optimum);

/// Says for users what unexplained light means.
std::string unexplained_hint(double probability);

}  // namespace blindcorner
