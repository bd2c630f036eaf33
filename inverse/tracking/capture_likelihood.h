// SPDX-License-Identifier: Apache-2.0
/// A capture's likelihood for the tracker: Fisher scoring about a predicted pose.
#pragma once

#include <memory>

#include "blindcorner/inverse/tracking/frame_likelihood.h"
#include "inverse/search/compiled_scene.h"

namespace blindcorner {

/// The result shares `compiled` and copies the capture. Throws Error when the capture does not suit
/// the scene.
std::unique_ptr<FrameLikelihood> make_capture_likelihood(
    std::shared_ptr<const CompiledScene> compiled, const Capture& capture,
    const FitOptions& options);

}  // namespace blindcorner
