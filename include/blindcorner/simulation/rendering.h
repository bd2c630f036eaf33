// SPDX-License-Identifier: Apache-2.0
/// Captures of a scene from a forward model, as `blindcorner render` makes them.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/io/capture_file.h"

namespace blindcorner {

struct RenderOptions {
  std::string model = "reference";  ///< or "fast"
  bool noiseless = false;           ///< expected values; no ambient light, no measured background
  bool empty = false;               ///< no hidden object
  std::uint64_t seed = 1;           ///< seed of the photons
  double photons = 0;  ///< three-bounce photons, over an equal background; 0: the scene's exposure
  FastModelOptions fast;  ///< options of the fast model
  /// Cells of the reference renderer along each axis, in units of the usual number. Empty: 1, or 2
  /// above 100,000 photons.
  std::optional<double> sampling;
  std::optional<int> zone_divisions, field_divisions;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Callbacks while captures are made, from any thread. Either may be empty.
struct RenderHooks {
  std::function<void()> advance;  ///< called after each capture
  std::function<bool()> stop;     ///< returns true: no further capture is begun
};

/// Number of captures for these numbers of lists of placements and of sensor poses. Equal numbers
/// are paired, the first with the first. A single one goes with all of the other kind. Throws Error
/// for other numbers.
std::size_t capture_count(std::size_t placements, std::size_t sensors);

/// One capture for each list of placements (one for each object) and pose of the sensor. Capture i
/// depends on the seed and i alone. Captures that were not begun have no counts.
CaptureFile render_captures(const Scene& scene,
                            const std::vector<std::vector<Placement>>& placements,
                            const std::vector<Transform>& sensors, const RenderOptions& options,
                            const RenderHooks& hooks = {});

}  // namespace blindcorner
