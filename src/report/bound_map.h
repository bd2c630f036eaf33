// SPDX-License-Identifier: Apache-2.0
/// A map of the error to expect, drawn from above.
#pragma once

#include <string>

#include "report/bound_page.h"

namespace blindcorner {

/// Range of errors, m, that the colours stand for.
struct ErrorScale {
  double least = 0.01, most = 1;
};

/// Of all maps together, without the few most extreme places.
ErrorScale error_scale(const std::vector<BoundMap>& maps);

/// The whole scene: sensor, what it sees, surfaces, the hidden area in colours. One <svg> element.
std::string overview_svg(const BoundMap& map, const ErrorScale& scale);

/// The hidden area by itself, with hatching where nothing would be noticed.
std::string area_svg(const BoundMap& map, const ErrorScale& scale);

/// The colours and what they stand for.
std::string scale_svg(const ErrorScale& scale);

}  // namespace blindcorner
