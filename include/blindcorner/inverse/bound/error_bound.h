// SPDX-License-Identifier: Apache-2.0
/// How well any method can do: error to expect and probability of detection at a place, before
/// there is a capture.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/transport/forward_model.h"

namespace blindcorner {

struct BoundOptions {
  /// Light of one capture: the scene's own, or as a link budget says.
  double exposures = 1.0;  ///< > 0, how many are averaged
  double ambient = 0.0;    ///< >= 0, counts per bin of one exposure
  /// Poses of the search region that are looked at for being mistaken for each other. What lies
  /// between them is not found, which makes the bound lower, never wrong.
  int test_poses = 1000;          ///< by judgement: ten along each axis of three unknowns
  bool prior = true;              ///< count what the scene says about the pose before any capture
  double model_tolerance = 0.05;  ///< of the fast model, by judgement
  int empty_captures = 128;       ///< simulated for the false-alarm threshold, as a fit's
  std::uint64_t seed = 1;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Bounds on the errors of the unknowns when the object is at one pose. Matrices are [n, n]
/// covariances, SI units, in the order of the scene's unknowns.
struct PoseBound {
  PoseVector pose;
  double photons = 0;  ///< expected of the object's light
  /// Cramer-Rao bound of the photons alone; holds for unbiased methods that know the right place
  /// roughly. Unknowns that the light says nothing about have huge variances.
  Eigen::MatrixXd cramer_rao;
  /// The same with the prior counted as a measurement (van Trees at this pose).
  Eigen::MatrixXd with_prior;
  /// Weiss and Weinstein's bound with s = 1/2 over the poses that look like this one: holds for any
  /// method, ambiguous or not.
  Eigen::MatrixXd ambiguity;
  /// Distance over all unknown positions, m: square root of the larger trace of the last two.
  double position_error = 0;
  bool ambiguous = false;  ///< the ambiguity bound is the larger one
  /// Share of captures in which an object here would be noticed, at the threshold that a fit has.
  double detection_probability = 0;
};

/// Trace over the positions among the unknowns, m^2.
double position_trace(const Scene& scene, const Eigen::MatrixXd& covariance);

/// The bounds of one scene and one place of its sensor.
class ErrorBound {
 public:
  /// Called after each test pose, from any thread. With it they are looked at when this is made,
  /// else when somebody asks for what needs them.
  using Advance = std::function<void()>;

  ErrorBound(const Scene& scene, const SensorPlacement& placement, const BoundOptions& options = {},
             const Advance& advance = {});
  ~ErrorBound();
  ErrorBound(ErrorBound&&) noexcept;
  ErrorBound& operator=(ErrorBound&&) noexcept;

  /// With an object `brightness` times as bright as the scene states (the median of its prior where
  /// the brightness is unknown). Thread safe.
  PoseBound at(const PoseVector& pose, double brightness = 1.0) const;

  /// Cramer-Rao bound alone, [n, n]: what at() gives as `cramer_rao`, without what takes its time.
  Eigen::MatrixXd cramer_rao(const PoseVector& pose, double brightness = 1.0) const;

  /// [n, n] Covariance of the estimate about errors of the light that it is made from, which no
  /// number of photons averages out. `error`: their standard deviation in W/m^2 [zones][bins];
  /// `correlation` [bins, bins], positive definite: of those of one zone; zones have errors of
  /// their own.
  Eigen::MatrixXd carried_error(const PoseVector& pose, const HistogramCube& error,
                                const Eigen::MatrixXd& correlation, double brightness = 1.0) const;

  /// [n, n] Covariance of the prior.
  const Eigen::MatrixXd& prior() const;
  /// Position error of an answer that does not look at the capture, m.
  double prior_error() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace blindcorner
