// SPDX-License-Identifier: Apache-2.0
/// Perceptions that ask a trained network, frame by frame. As published, a network always claims
/// that the object is there: it has no answer for an empty place.
#pragma once

#include <memory>

#include "blindcorner/simulation/perception.h"

namespace blindcorner {

/// "cnn": the published network. Its answer has no covariance and goes to the map as the published
/// disc. Throws Error unless the setup has its weights.
std::unique_ptr<Perception> make_cnn_perception(const PerceptionSetup& setup);

/// "cnn_wide": the ensemble, whose answer goes to the map with its covariance.
std::unique_ptr<Perception> make_wide_cnn_perception(const PerceptionSetup& setup);

}  // namespace blindcorner
