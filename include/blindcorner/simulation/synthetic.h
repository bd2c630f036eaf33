// SPDX-License-Identifier: Apache-2.0
/// Synthetic captures: poses from the prior, light from a model, counts from the noise model.
#pragma once

#include <cstdint>
#include <optional>
#include <random>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/forward/transport/forward_model.h"

namespace blindcorner {

/// Pose drawn from the scene's prior.
PoseVector draw_pose(const Scene& scene, std::mt19937_64& random);

/// How bright a synthetic capture is.
struct LightBudget {
  /// Photons of the three-bounce light in the whole capture; the exposure is chosen to give it.
  /// Empty: one exposure at the scene's gain and its stated ambient light.
  std::optional<double> third_bounce_photons;
  /// Ambient photons for each three-bounce photon within the bins that hold 90 % of that light.
  double background_ratio = 1.0;
  /// Brightness of the object in units of what the scene states (albedo and amplitude).
  double amplitude = 1.0;
};

/// Sum over all bins of the three-bounce light at a pose, W/m^2.
double total_light(const ForwardModel& model, const PoseVector& pose);

/// Ambient light, counts per bin and exposure, that is as strong as the light (W/m^2 per bin, gains
/// not applied) within the bins that hold 90 % of it.
double equal_ambient(const Scene& scene, const HistogramCube& light);

/// Counts of one exposure over all bins of live zones, no ambient light.
double total_counts(const Scene& scene, const HistogramCube& light);

/// A noisy capture of the scene at one pose, truth and the sensor's pose included. Throws Error
/// when a photon budget is asked of a pose that sends the sensor no light.
Capture make_capture(const Scene& scene, const ForwardModel& model, const PoseVector& pose,
                     const LightBudget& budget, std::uint64_t seed);

}  // namespace blindcorner
