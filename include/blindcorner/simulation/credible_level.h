// SPDX-License-Identifier: Apache-2.0
/// Tests whether a posterior holds the truth as often as it claims.
#pragma once

#include <cstdint>
#include <span>

#include "blindcorner/forward/scene/pose_mixture.h"
#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

/// Probability of the mixture's region of highest density whose border runs through `truth`, from
/// samples (to 0.5 % with 2000 samples). The truth lies in the 95 % region if this probability is
/// at most 0.95. For a single mode, it is the chi-square probability of the squared Mahalanobis
/// distance.
double credible_level(const Scene& scene, const PoseMixture& mixture, const PoseVector& truth,
                      int samples = 2000, std::uint64_t seed = 1);

/// 95 % interval of a share found in `trials` trials (Wilson 1927). Without trials, it is 0 to 1.
struct ShareInterval {
  double low = 0, high = 1;
};
ShareInterval wilson_interval(int successes, int trials);

/// Mean of values with its 95 % interval (Student's t).
struct MeanInterval {
  double mean = 0;
  double low = 0, high = 0;
};
/// Throws Error for fewer than two values.
MeanInterval mean_interval(std::span<const double> values);

}  // namespace blindcorner
