// SPDX-License-Identifier: Apache-2.0
/// What an instrument's makers leave open in whole numbers: which relay spot is which zone's, and
/// after how many bins a time axis wraps.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "inverse/calibration/calibration_problem.h"

namespace blindcorner {

/// Most spots whose assignments are all tried (120 of them; six spots would have 720).
inline constexpr std::size_t kMaxSpots = 5;

struct Layout {
  Scene scene;                              ///< the scene given, with the best layout
  std::vector<SpotAssignment> assignments;  ///< best first; empty: not tried
  std::vector<ZoneWrap> wraps;              ///< of zones whose data decide
};

/// Tries what the options say: all assignments of at most kMaxSpots spots, every wrap in the
/// farther half of the time axis, and each of them with each of the others: with a wrong wrap the
/// right spot is refuted, and the other way round. Zones have the gain that suits them, all the
/// time zero that suits them together; other parameters are as stated. `poses` is [captures], all
/// known. `advance` is called with the share done, 0 to 1.
Layout find_layout(const Scene& scene, const std::vector<Capture>& captures,
                   const std::vector<std::optional<PoseVector>>& poses,
                   const CalibrationOptions& options, const std::function<void(double)>& advance);

}  // namespace blindcorner
