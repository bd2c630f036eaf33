// SPDX-License-Identifier: Apache-2.0
/// Checks whether a scene can be used for computation, whatever its source.
#pragma once

#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

/// Checks a scene against the limits of scene files. Throws Error with one line for each problem,
/// in the fields and units of scene files (docs/scene.md): "scene: sensor.bin_width_ps: found -100,
/// accepted: a number > 0 and <= 1000000000". Everything that takes a scene calls it.
void validate(const Scene& scene);

}  // namespace blindcorner
