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

/// The range of all maps together. The few most extreme places are left out.
ErrorScale error_scale(const std::vector<BoundMap>& maps);

/// The whole scene: the sensor, what it sees, the surfaces, and the hidden area in colours. One
/// <svg> element. `number` tells this map from the others on the page.
std::string overview_svg(const BoundMap& map, const ErrorScale& scale, int number);

/// The hidden area by itself, with hatching where nothing would be noticed.
std::string area_svg(const BoundMap& map, const ErrorScale& scale, int number);

/// The colours and what they stand for, in a line that breaks where the page is narrow.
std::string scale_html(const ErrorScale& scale);

}  // namespace blindcorner
