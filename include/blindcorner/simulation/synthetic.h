// SPDX-License-Identifier: Apache-2.0
/// Synthetic captures: poses from the prior, light from a model, counts from the noise model.
#pragma once

#include <cstdint>
#include <optional>
#include <random>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/forward/transport/forward_model.h"

namespace blindcorner {

/// Pose drawn from the scene's prior.
PoseVector draw_pose(const Scene& scene, std::mt19937_64& random);

/// How bright a synthetic capture is.
struct LightBudget {
  /// Photons of the three-bounce light in the whole capture. The exposure is chosen to give this
  /// number. Empty: one exposure at the scene's gain and its stated ambient light.
  std::optional<double> third_bounce_photons;
  /// Ambient photons for each three-bounce photon, within the bins that hold 90 % of the
  /// three-bounce light.
  double background_ratio = 1.0;
  /// Brightness of the object, in units of the brightness that the scene states (albedo and
  /// amplitude).
  double amplitude = 1.0;
};

/// Sum over all bins of the three-bounce light at a pose, W/m^2.
double total_light(const ForwardModel& model, const PoseVector& pose);

/// Ambient light, counts per bin and exposure, that is as strong as `light` within the bins that
/// hold 90 % of `light`. `light` is in W/m^2 per bin, without gains.
double equal_ambient(const Scene& scene, const HistogramCube& light);

/// Counts of one exposure over all bins of live zones, without ambient light.
double total_counts(const Scene& scene, const HistogramCube& light);

/// Number of exposures and ambient light of captures, whatever object they show.
struct Exposure {
  double exposures = 1.0;
  double ambient = 0.0;  ///< counts per bin of one exposure
};

/// The scene's own exposure: one exposure and its stated ambient light.
Exposure own_exposure(const Scene& scene);

/// The exposure that gives `photons` photons of the third bounce on average over the search region,
/// for objects of the brightness that the scene states. The background is equal to the object's
/// light in the light's time gate, but an ambient light that the scene fixes stays. Throws Error if
/// no pose sends light to the sensor.
Exposure exposure_for(const Scene& scene, const ForwardModel& model, double photons,
                      std::uint64_t seed);

/// A noisy capture, the average of `exposures` exposures, of light in W/m^2 per bin. The capture
/// has no truth.
Capture capture_of_light(const Scene& scene, const HistogramCube& three_bounce,
                         const HistogramCube& static_background, const LinearValues& linear,
                         double exposures, std::uint64_t seed);

/// Sets the pose as the capture's truth.
void set_truth(const Scene& scene, const PoseVector& pose, Capture& capture);

/// A noisy capture of the scene at one pose, with its truth and the sensor's pose. Throws Error if
/// a photon budget is asked of a pose that sends no light to the sensor.
Capture make_capture(const Scene& scene, const ForwardModel& model, const PoseVector& pose,
                     const LightBudget& budget, std::uint64_t seed);

}  // namespace blindcorner
