// SPDX-License-Identifier: Apache-2.0
/// Steps of the numeric derivatives.
#pragma once

#include "blindcorner/forward/transport/forward_model.h"

namespace blindcorner {

/// Finite-difference step of each unknown, m, rad or 1, for central differences of the expected
/// histogram. Unless a limit for yaw, size or range is lower, it is 6 % of the pulse's width in
/// path length. The truncation error is then (h / sigma)^2 / 6 = 6e-4, and the steps are far
/// above the model's rounding and kinks.
PoseVector difference_steps(const Scene& scene, const SensorPlacement& placement);

}  // namespace blindcorner
