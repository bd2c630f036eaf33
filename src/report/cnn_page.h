// SPDX-License-Identifier: Apache-2.0
/// Training and evaluation of the learned baseline: pages, and the losses as CSV.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/inverse/baseline/cnn_training.h"
#include "report/point_estimates.h"

namespace blindcorner {

/// training.csv: `epoch,training_loss,validation_loss`.
std::string training_csv(const std::vector<CnnEpoch>& history);

/// Loss curves, and the errors on captures that were held back (may be none).
std::string training_page(const Scene& scene, const CnnTrainingOptions& options,
                          const CnnTrainingResult& result,
                          const std::vector<PointEstimate>& held_back);

/// Errors, their distribution and a bird's-eye view. `capture_ms` is the median time that a capture
/// took.
std::string cnn_evaluation_page(const Scene& scene, const CnnDescription& network,
                                const std::vector<PointEstimate>& estimates, double capture_ms);

}  // namespace blindcorner
