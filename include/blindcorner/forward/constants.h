// SPDX-License-Identifier: Apache-2.0
/// Physical and mathematical constants.
#pragma once

#include <numbers>

namespace blindcorner {

/// Speed of light in vacuum, m/s (exact, SI).
inline constexpr double kSpeedOfLight = 299'792'458.0;
inline constexpr double kPi = std::numbers::pi;
inline constexpr double kDegree = kPi / 180.0;
/// Full width at half maximum of a Gaussian over its standard deviation, 2 sqrt(2 ln 2).
inline constexpr double kGaussianFwhm = 2.354820045030949;

}  // namespace blindcorner
