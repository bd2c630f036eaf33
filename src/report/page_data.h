// SPDX-License-Identifier: Apache-2.0
/// Parts of a scene that pages embed in order to draw them, as JSON for their scripts.
#pragma once

#include <nlohmann/json.hpp>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/inverse/fit.h"

namespace blindcorner {

/// Surfaces, search region, objects and sensor of a scene.
nlohmann::json page_scene(const Scene& scene);
/// What the scene's sensor sees from where the scene puts it.
nlohmann::json page_view(const Scene& scene);
/// Measured and fitted histograms of at most `max_zones` zones: those with most light from the
/// object.
nlohmann::json page_histograms(const Scene& scene, const FittedHistograms& fitted, int max_zones);

}  // namespace blindcorner
