// SPDX-License-Identifier: Apache-2.0
/// A small object of measured brightness, seen from spots on the relay.
#pragma once

#include <memory>

#include "blindcorner/forward/transport/forward_model.h"

namespace blindcorner {

/// Light of zone z at its relay spot r, object at q: a single pulse that arrives after twice
/// |s r| + |r q| (s the sensor), weighing albedo * cos^n / (|r q| / 1 m)^m. Throws Error when the
/// zones are not relay spots. `extra_pulse_sigma` as FastModelOptions', s.
std::unique_ptr<ForwardModel> make_measured_law_model(const Scene& scene,
                                                      const SensorPlacement& placement,
                                                      double extra_pulse_sigma);

}  // namespace blindcorner
