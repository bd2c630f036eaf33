// SPDX-License-Identifier: Apache-2.0
/// A small object of measured brightness, seen from spots on the relay.
#pragma once

#include <memory>

#include "blindcorner/forward/transport/forward_model.h"

namespace blindcorner {

/// Light of zone z with the relay spot r, for an object at q: a single pulse of weight albedo *
/// cos^n / (|r q| / 1 m)^m. It arrives after twice |s r| + |r q| (s is the sensor), or twice |r q|
/// if paths count from the relay. Throws Error when the zones are not relay spots.
/// `extra_pulse_sigma`, s, is that of FastModelOptions.
std::unique_ptr<ForwardModel> make_measured_law_model(const Scene& scene,
                                                      const SensorPlacement& placement,
                                                      double extra_pulse_sigma);

}  // namespace blindcorner
