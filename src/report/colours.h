// SPDX-License-Identifier: Apache-2.0
/// One colour for one thing, on all pages. The variables are defined in theme.css, for light and
/// dark pages. The values after the commas serve pictures that stand alone.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace blindcorner::colour {

inline constexpr const char* kFound = "var(--found,#d55e00)";  ///< what the solver says
inline constexpr const char* kTruth = "var(--truth,#009e73)";
inline constexpr const char* kModel = "var(--model,#0072b2)";
inline constexpr const char* kMeasured = "var(--measured,#3d454d)";
inline constexpr const char* kSensor = "var(--sensor,#1b1f24)";
inline constexpr const char* kGoal = "var(--goal,#cc79a7)";
inline constexpr const char* kGrid = "var(--grid,#e7ebee)";
inline constexpr const char* kLine = "var(--line,#8b949d)";
inline constexpr const char* kPaper = "var(--paper,#fff)";
inline constexpr const char* kInk = "var(--ink,#1b1f24)";

/// Colour of the i-th series of a chart, for series without a colour of their own.
std::string of_series(std::size_t i);

/// Colour of a perception or a method, by its name. The solver has the colour of what it finds, the
/// oracle that of the truth. Unknown names take the colours of series by `place`.
std::string of_method(std::string_view name, std::size_t place = 0);

}  // namespace blindcorner::colour
