// SPDX-License-Identifier: Apache-2.0
/// Posteriors that are not quite normal: how they fall along a principal axis of their Laplace
/// approximation, and what their moments then are.
#pragma once

#include <Eigen/Core>
#include <array>

namespace blindcorner {

/// Laplace's approximation holds where the log posterior, 1.5 standard deviations from the optimum
/// along every principal axis, has fallen by 1.5^2 / 2, give or take this factor. The posterior's
/// width is then right to the factor's root, 16 %. Among 2000 captures of a plate and board, those
/// for which Laplace held had a mean squared normalised error of 1.14 with a factor of 1.5, and of
/// 1.08 with this factor and moments along the axes. A factor of 1.25 gives 1.06 and makes a frame
/// of the street a seventh dearer.
constexpr double kSigmaPoint = 1.5;
constexpr double kLaplaceFactor = 1.35;
/// At this many standard deviations, the log posterior must have fallen by at least 3^2 / 2 over
/// that factor: along ridges of equal paths it falls like a Gaussian's at first and then no more.
constexpr double kTailPoint = 3;
/// Points at which the fall is evaluated, in standard deviations, ascending.
constexpr std::array kAway{-kTailPoint, -kSigmaPoint, 0.0, kSigmaPoint, kTailPoint};

/// Principal axes of a covariance as columns, each one standard deviation long.
Eigen::MatrixXd principal_deviations(const Eigen::MatrixXd& covariance);

/// Fall of a log posterior divided by the fall of its Gaussian, at the points of kAway.
using FallRatios = std::array<double, kAway.size()>;

/// Whether Laplace holds at the points that are kSigmaPoint away; the others are not looked at.
bool falls_like_gaussian(const FallRatios& ratios);

/// Integrals along an axis on which the log posterior falls by `ratio(t) t^2 / 2` at `t` standard
/// deviations of its Gaussian. The ratio is linear between the points of kAway and constant beyond
/// them.
struct AlongAxis {
  double mass = 0, mean = 0, variance = 0;  ///< in units of the Gaussian's
};
AlongAxis integrate_along(const FallRatios& ratios);

}  // namespace blindcorner
