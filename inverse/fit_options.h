// SPDX-License-Identifier: Apache-2.0
/// What a fit accepts, beside its options.
#pragma once

#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

/// Throws Error naming what a fit cannot work with: it needs a valid scene with something to fit,
/// and a relay that can be seen.
void validate_scene(const Scene& scene);

}  // namespace blindcorner
