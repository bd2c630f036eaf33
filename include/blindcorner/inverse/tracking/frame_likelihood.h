// SPDX-License-Identifier: Apache-2.0
/// What one frame says about the hidden object, in the form in which a tracker asks for it.
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

/// Likelihood of one frame. Its vectors are the scene's unknowns in their order (SI units), then,
/// where all zones share one unknown amplitude, its natural logarithm: an object keeps its
/// brightness from frame to frame as it keeps its height.
class FrameLikelihood {
 public:
  struct Update {
    Gaussian posterior;
    double log_evidence =
        0;  ///< log of the integral of likelihood times prior, this optimum's part
    double log_likelihood = 0;  ///< at the optimum, linear unknowns maximised
  };

  virtual ~FrameLikelihood() = default;

  /// Posterior under a normal prior about the optimum to which a descent from `start` leads, by
  /// Laplace's method. The likelihood is raised to the power 1 / inflation.
  virtual Update update(const Gaussian& prior, const Eigen::VectorXd& start,
                        double inflation) const = 0;

  /// The same without what a finer model of the light would tell, and as much less sure: for one of
  /// several places, of which the next frames tell more.
  virtual Update rough_update(const Gaussian& prior, const Eigen::VectorXd& start,
                              double inflation) const {
    return update(prior, start, inflation);
  }

  /// Places worth descending from when nothing is known, the best first.
  virtual std::vector<Eigen::VectorXd> starts() const = 0;

  /// Log evidence of a scene without the object, on the scale of Update::log_evidence.
  virtual double log_evidence_empty(double inflation) const = 0;

  /// What a look at all places of the search region tells that follows none of them. Infinities: it
  /// cannot be told so.
  struct Look {
    /// Log evidence of an object that may be anywhere, on the scale of Update::log_evidence.
    double log_evidence = std::numeric_limits<double>::infinity();
    /// What the frame says of the place (Kullback and Leibler), nats: 0 where all are as good.
    double information = std::numeric_limits<double>::infinity();
  };
  virtual Look look(double /*inflation*/) const { return {}; }

  /// Adds to a result what a page shows of this frame: histograms and goodness of fit.
  virtual void describe(const Eigen::VectorXd& at, FitResult& result) const = 0;
};

}  // namespace blindcorner
