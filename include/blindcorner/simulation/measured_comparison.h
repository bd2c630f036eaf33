// SPDX-License-Identifier: Apache-2.0
/// Methods compared on measured captures: what learns or is calibrated does so with some of them,
/// all answer the others.
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

/// What is measured: captures with their truth.
struct MeasuredCaptures {
  std::vector<Capture> captures;
  /// Others at the same positions, with fewer exposures; may be empty. Networks learn them as well,
  /// and folds are evaluated on them besides.
  std::vector<Capture> samples;
};

/// One condition for each scheme of splits. Solver and classical methods are told the scene as it
/// is calibrated with the captures that are learnt. `stage` is told what is done next. Throws Error
/// for captures without truth, and where no scheme has a split.
SceneComparison compare_measured(const Scene& scene, const MeasuredCaptures& measured,
                                 const MeasuredComparisonOptions& options,
                                 const std::function<void(const std::string&)>& stage = {});

}  // namespace blindcorner
