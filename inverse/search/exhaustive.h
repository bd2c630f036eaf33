// SPDX-License-Identifier: Apache-2.0
/// Exhaustive search over the poses: slow, simple, and the yardstick for the solver.
#pragma once

#include <memory>
#include <vector>

#include "blindcorner/forward/scene/pose_mixture.h"
#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/inverse/fit.h"

namespace blindcorner {

struct ExhaustiveOptions {
  double model_tolerance = 0.1;  ///< as FitOptions::model_tolerance: the same model is searched
  /// Grid points per grid step of the fit, along each unknown. The spacing is 1.2 / 1.6 = 0.75 of
  /// the pulse, at which a spline would be right to 0.25 %.
  double density = 1.6;
  int max_poses = 150'000;  ///< the density is lowered to stay below: a limit of time and memory
  /// Number of the best separated grid points that are refined. By judgement: more than a fit's
  /// starts.
  int refined = 40;

  void validate() const;
};

/// A result that no solver can improve on.
struct ExhaustiveResult {
  double log_posterior = 0;  ///< of the best pose, linear unknowns maximised, priors included
  PoseVector pose;           ///< the best pose
  PoseMode heaviest;         ///< heaviest mode of the posterior summed over the grid
};

/// Evaluates the likelihood at every point of a fine grid, with the sharp pulse, and refines the
/// best ones. Expected histograms are computed once per scene.
class ExhaustiveSearch {
 public:
  explicit ExhaustiveSearch(const Scene& scene, const ExhaustiveOptions& options = {});
  ~ExhaustiveSearch();
  ExhaustiveSearch(ExhaustiveSearch&&) noexcept;

  /// `starts` are refined as well, for example another solver's result or the truth. Thread safe.
  ExhaustiveResult search(const Capture& capture, std::vector<PoseVector> starts = {}) const;

  /// Log posterior of one pose. Thread safe.
  double log_posterior(const Capture& capture, const PoseVector& pose) const;

  /// The optimum that a descent from `start` alone leads to. Thread safe.
  struct Optimum {
    double log_posterior = 0;
    PoseVector pose;
  };
  Optimum descend(const Capture& capture, const PoseVector& start) const;

  int poses() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace blindcorner
