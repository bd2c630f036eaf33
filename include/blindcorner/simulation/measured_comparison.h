// SPDX-License-Identifier: Apache-2.0
/// Compares methods on measured captures. Methods that learn or are calibrated use some of the
/// captures. All methods answer the others.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "blindcorner/inverse/baseline/cnn_training.h"
#include "blindcorner/inverse/calibration/calibration.h"
#include "blindcorner/inverse/fit.h"
#include "blindcorner/simulation/comparison.h"
#include "blindcorner/simulation/position_splits.h"

namespace blindcorner {

/// A network that is trained anew for each split.
struct LearnedMethod {
  std::string name;
  CnnTrainingOptions training;
};

struct MeasuredComparisonOptions {
  SplitOptions splits;
  CalibrationOptions calibration;
  FitOptions fit;
  std::vector<LearnedMethod> networks;  ///< empty without libtorch
  std::uint64_t seed = 1;

  void validate() const;
};

/// Measured captures with their truth.
struct MeasuredCaptures {
  std::vector<Capture> captures;
  /// Other captures at the same positions, with fewer exposures. May be empty. Networks learn from
  /// them as well, and folds are also evaluated on them.
  std::vector<Capture> samples;
};

/// One condition for each scheme of splits, and one more for the samples of folds. The solver and
/// the classical methods are told the scene as calibrated with the learnt captures. `stage` is told
/// the next step. Throws Error for captures without truth, and if no scheme has a split.
SceneComparison compare_measured(const Scene& scene, const MeasuredCaptures& measured,
                                 const MeasuredComparisonOptions& options,
                                 const std::function<void(const std::string&)>& stage = {});

}  // namespace blindcorner
