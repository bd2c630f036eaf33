// SPDX-License-Identifier: Apache-2.0
/// Limits of any method at a place, before there is a capture: the error to expect and the
/// probability of detection.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/transport/forward_model.h"

namespace blindcorner {

struct BoundOptions {
  /// Light of one capture: the scene's own, or from a link budget.
  double exposures = 1.0;  ///< > 0, number of averaged exposures
  double ambient = 0.0;    ///< >= 0, counts per bin and exposure, where the scene fixes none
  /// Poses of the search region that are tested for confusion with each other. Confusion with poses
  /// between them is not found, which makes the bound lower, never wrong.
  int test_poses = 1000;          ///< by judgement: ten along each axis of three unknowns
  bool prior = true;              ///< include what the scene says about the pose before any capture
  double model_tolerance = 0.05;  ///< of the fast model, by judgement
  int empty_captures = 128;       ///< simulated for the false-alarm threshold, as for a fit
  std::uint64_t seed = 1;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Bounds on the errors of the unknowns when the object is at one pose. Matrices are [n, n]
/// covariances, SI units, in the order of the scene's unknowns.
struct PoseBound {
  PoseVector pose;
  double photons = 0;  ///< expected number of the object's photons
  /// Cramer-Rao bound of the photons alone. It holds for unbiased methods that know the right place
  /// roughly. Unknowns that the light says nothing about have huge variances.
  Eigen::MatrixXd cramer_rao;
  /// The same with the prior counted as a measurement (van Trees at this pose).
  Eigen::MatrixXd with_prior;
  /// Weiss and Weinstein's bound with s = 1/2 over the poses that look like this one. It holds for
  /// any method, ambiguous or not.
  Eigen::MatrixXd ambiguity;
  /// Distance over all unknown positions, m: square root of the larger trace of `with_prior` and
  /// `ambiguity`.
  double position_error = 0;
  bool ambiguous = false;  ///< the ambiguity bound is the larger one
  /// Share of captures in which an object here would be noticed, at the threshold of a fit.
  double detection_probability = 0;
};

/// Trace over the position unknowns, m^2.
double position_trace(const Scene& scene, const Eigen::MatrixXd& covariance);

/// The bounds of one scene and one sensor placement.
class ErrorBound {
 public:
  /// Called after each test pose, from any thread. If it is given, the constructor evaluates the
  /// test poses; else the first call that needs them does.
  using Advance = std::function<void()>;

  ErrorBound(const Scene& scene, const SensorPlacement& placement, const BoundOptions& options = {},
             const Advance& advance = {});
  ~ErrorBound();
  ErrorBound(ErrorBound&&) noexcept;
  ErrorBound& operator=(ErrorBound&&) noexcept;

  /// The bounds for an object `brightness` times as bright as the scene states (the median of its
  /// prior where the brightness is unknown). Thread safe.
  PoseBound at(const PoseVector& pose, double brightness = 1.0) const;

  /// The Cramer-Rao bound alone, [n, n]: equal to `cramer_rao` of at(), without the slow parts of
  /// at().
  Eigen::MatrixXd cramer_rao(const PoseVector& pose, double brightness = 1.0) const;

  /// [n, n] Covariance of the estimate due to errors of the light that the estimate is made from.
  /// No number of photons averages these errors out. `error` is their standard deviation, W/m^2
  /// [zones][bins]. `correlation` [bins, bins], positive definite, is the correlation of the errors
  /// of one zone. Errors of different zones are independent.
  Eigen::MatrixXd carried_error(const PoseVector& pose, const HistogramCube& error,
                                const Eigen::MatrixXd& correlation, double brightness = 1.0) const;

  /// [n, n] Covariance of the prior.
  const Eigen::MatrixXd& prior() const;
  /// Position error of an answer that ignores the capture, m.
  double prior_error() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace blindcorner
