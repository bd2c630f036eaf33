// SPDX-License-Identifier: Apache-2.0
/// Captures as text for a terminal.
#pragma once

#include <string>

#include "blindcorner/io/capture_file.h"

namespace blindcorner {

struct DescribeOptions {
  int capture = 0;  ///< capture whose histograms are drawn; -1: none
  int width = 64;   ///< characters per histogram; more bins than that are pooled (averaged)
  bool logarithmic = false;  ///< draw log(1 + count) from its lowest value, not the count

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Several lines (UTF-8): the size of the captures, the time axis, what is known about the
/// captures, and how many values are NaN, infinite or negative. Then follows one line per zone of
/// the chosen capture with its total, its peak and a drawing of the histogram, scaled to the zone's
/// own peak. A pool that contains a NaN is drawn as `?`. Throws Error when the chosen capture does
/// not exist.
std::string describe(const CaptureFile& file, const DescribeOptions& options = {});

}  // namespace blindcorner
