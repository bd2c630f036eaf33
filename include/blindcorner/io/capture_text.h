// SPDX-License-Identifier: Apache-2.0
/// Captures as text for a terminal.
#pragma once

#include <string>

#include "blindcorner/io/capture_file.h"

namespace blindcorner {

struct DescribeOptions {
  int capture = 0;  ///< which capture's histograms to draw; -1: none
  int width = 64;   ///< characters per histogram; more bins than that are pooled (averaged)
  bool logarithmic = false;  ///< draw log(1 + count), from its lowest value, not the count

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Several lines (UTF-8): size of the captures, time axis, what is known about each, how many
/// values are NaN, infinite or negative, and one line per zone of the chosen capture with its
/// total, peak and a drawing of the histogram, each zone scaled to its own peak. A pool that holds
/// a NaN is drawn as `?`. Throws Error when there is no such capture.
std::string describe(const CaptureFile& file, const DescribeOptions& options = {});

}  // namespace blindcorner
