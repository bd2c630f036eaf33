// SPDX-License-Identifier: Apache-2.0
/// The likelihood of one frame about the hidden object, in the form that a tracker needs.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "blindcorner/inverse/fit.h"

namespace blindcorner {

/// A normal distribution.
struct Gaussian {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

/// Likelihood of one frame. Its vectors hold the scene's unknowns in order (SI units). Where all
/// zones share one unknown amplitude, the amplitude's natural logarithm follows: an object keeps
/// its brightness from frame to frame as it keeps its height.
class FrameLikelihood {
 public:
  struct Update {
    Gaussian posterior;
    double log_evidence = 0;    ///< log integral of likelihood times prior, this optimum's part
    double log_likelihood = 0;  ///< at the optimum, linear unknowns maximised
  };

  virtual ~FrameLikelihood() = default;

  /// Posterior under a normal prior, about the optimum that a descent from `start` reaches, by
  /// Laplace's method. The likelihood is raised to the power 1 / inflation.
  virtual Update update(const Gaussian& prior, const Eigen::VectorXd& start,
                        double inflation) const = 0;

  /// The same with a cheaper light, and accordingly less certain. It is for one of several places,
  /// about which the next frames tell more.
  virtual Update rough_update(const Gaussian& prior, const Eigen::VectorXd& start,
                              double inflation) const {
    return update(prior, start, inflation);
  }

  /// Starts of descents for when nothing is known, the best first.
  virtual std::vector<Eigen::VectorXd> starts() const = 0;

  /// Log evidence of a scene without the object, on the scale of Update::log_evidence.
  virtual double log_evidence_empty(double inflation) const = 0;

  /// Result of a look at all places of the search region, without a descent from any of them.
  /// Infinities: no such result is available.
  struct Look {
    /// Log evidence of an object that may be anywhere, on the scale of Update::log_evidence.
    double log_evidence = std::numeric_limits<double>::infinity();
    /// Information of the frame about the place (Kullback and Leibler), nats; 0 where all places
    /// are equally good.
    double information = std::numeric_limits<double>::infinity();
  };
  virtual Look look(double /*inflation*/) const { return {}; }

  /// Adds to a result what a page shows of this frame: histograms and goodness of fit.
  virtual void describe(const Eigen::VectorXd& at, FitResult& result) const = 0;
};

}  // namespace blindcorner
