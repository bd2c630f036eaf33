// SPDX-License-Identifier: Apache-2.0
/// Error that poses which look alike cause in any method.
#pragma once

#include <Eigen/Core>

namespace blindcorner {

/// Lower bound on the covariance of the error of any estimate of one of K points, [n, n].
///
/// The posterior covariance is sum_ij q_i q_j d_ij d_ij' / 2, where q are the posterior
/// probabilities and d_ij is the difference of two points. By the inequality of Cauchy and Schwarz,
/// the expectation of q_i q_j is at least w_i w_j rho_ij^2, with the Bhattacharyya coefficient
/// rho_ij = sum sqrt(p_i p_j). For two equally probable points this is the bound of Weiss and
/// Weinstein (1985) with s = 1/2, rho^2 d^2 / 4. For points that no capture tells apart it is the
/// covariance of the weights.
///
/// `points` is [n, K], `weights` [K] holds their probabilities, and `roots` is [features, K] such
/// that rho_ij = exp(-|roots_i - roots_j|^2 / 2). For photon counts, the roots are the square roots
/// of the expected counts.
Eigen::MatrixXd ambiguity_bound(const Eigen::MatrixXd& points, const Eigen::VectorXd& weights,
                                const Eigen::MatrixXd& roots);

}  // namespace blindcorner
