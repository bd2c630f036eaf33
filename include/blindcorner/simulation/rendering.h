// SPDX-License-Identifier: Apache-2.0
/// Captures of a scene made by a forward model: what `blindcorner render` makes.
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
  std::uint64_t seed = 1;           ///< of photons
  double photons = 0;  ///< of the third bounce, over an equal background; 0: the scene's exposure
  FastModelOptions fast;  ///< of the fast model
  /// Cells of the reference renderer along each axis, in units of the usual ones; empty: 1, above
  /// 100,000 photons 2.
  std::optional<double> sampling;
  std::optional<int> zone_divisions, field_divisions;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// What is told and asked while captures are made, from any thread. Either may be empty.
struct RenderHooks {
  std::function<void()> advance;  ///< after each capture
  std::function<bool()> stop;     ///< true: no further capture is begun
};

/// Number of captures of so many lists of placements and poses of the sensor: the first of one goes
/// with the first of the other, and one goes with all. Throws Error for numbers that do not suit.
std::size_t capture_count(std::size_t placements, std::size_t sensors);

/// One capture for each list of placements (one for each object) and pose of the sensor. Capture i
/// depends on the seed and i alone. Those that were not begun have no counts.
CaptureFile render_captures(const Scene& scene,
                            const std::vector<std::vector<Placement>>& placements,
                            const std::vector<Transform>& sensors, const RenderOptions& options,
                            const RenderHooks& hooks = {});

}  // namespace blindcorner
