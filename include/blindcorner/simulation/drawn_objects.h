// SPDX-License-Identifier: Apache-2.0
/// Objects drawn from a scene's prior, and the light that they send. They serve studies that take
/// captures of each object at many levels of light.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/simulation/synthetic.h"

namespace blindcorner {

/// Source of the light in captures. Neither source is the fit's own model.
enum class TrueLight {
  reference,  ///< the reference renderer, pair by pair
  sensor,     ///< the simulated sensor of a drive: off by 1 to 2 %, takes milliseconds
};

/// A drawn object, and its light in W/m^2 per bin.
struct DrawnObject {
  PoseVector pose;  ///< values of the unknowns that methods are told of
  double amplitude = 1.0;
  HistogramCube three_bounce, static_background;
};

struct DrawOptions {
  static constexpr double kMinSampling = 0.1, kMaxSampling = 10;

  int objects = 100;
  TrueLight light = TrueLight::reference;
  double sampling = 1.0;  ///< sampling of the reference renderer, in units of its default
  /// How the true scene differs from the scene that methods are told: a name of
  /// wrong_assumptions(). Empty: it does not differ.
  std::string wrong;
  std::uint64_t seed = 1;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// One way in which the scene's description may be wrong.
struct WrongAssumption {
  std::string name, description;
  std::string left_out;  ///< why this scene cannot be changed in this way; empty: it can
};

/// All wrong assumptions: another albedo, size and material, a time zero that is off, a tilted
/// relay surface, a second object.
std::vector<WrongAssumption> wrong_assumptions(const Scene& scene);

/// Poses and brightness from the scene's priors, the same for every `wrong` and `light`, with the
/// light of the true scene. The results are the same at any number of threads. `advance` is called
/// after each object, from any thread. Throws Error if the scene cannot be changed as
/// `options.wrong` asks.
std::vector<DrawnObject> draw_objects(const Scene& scene, const DrawOptions& options,
                                      const std::function<void()>& advance = {});

/// A capture of a drawn object as the scene's sensor takes it, with its truth.
Capture capture_of(const Scene& scene, const DrawnObject& object, const Exposure& exposure,
                   std::uint64_t seed);

/// The same capture without noise.
Capture expected_capture_of(const Scene& scene, const DrawnObject& object,
                            const Exposure& exposure);

/// A capture of the scene without an object.
Capture empty_capture(const Scene& scene, const HistogramCube& static_background,
                      const Exposure& exposure, std::uint64_t seed);

/// The static background of the scene without an object, W/m^2 per bin.
HistogramCube empty_static_background(const Scene& scene);

}  // namespace blindcorner
