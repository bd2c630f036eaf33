// SPDX-License-Identifier: Apache-2.0
/// Whole numbers that an instrument's makers leave open: which relay spot belongs to which zone,
/// and after how many bins a time axis wraps.
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

/// Tries what the options say: all assignments of at most kMaxSpots spots, and every wrap in the
/// farther half of the time axis. Each assignment is tried with each wrap, because a wrong wrap
/// would refute the right spot and the other way round. Each zone has the gain that suits it, and
/// all zones share the time zero that suits them together. Other parameters are as stated. `poses`
/// is [captures], all known. `advance` is called with the share done, 0 to 1.
Layout find_layout(const Scene& scene, const std::vector<Capture>& captures,
                   const std::vector<std::optional<PoseVector>>& poses,
                   const CalibrationOptions& options, const std::function<void(double)>& advance);

}  // namespace blindcorner
