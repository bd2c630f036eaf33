// SPDX-License-Identifier: Apache-2.0
/// Plane cubic Bezier curves.
#pragma once

#include <Eigen/Core>
#include <array>

namespace blindcorner {

/// The curve of four control points for t from 0 to 1. All functions are defined for all control
/// points, collinear and repeated ones included.
struct CubicBezier {
  std::array<Eigen::Vector2d, 4> control;  ///< m

  Eigen::Vector2d point(double t) const;              ///< m
  Eigen::Vector2d derivative(double t) const;         ///< m per unit of t
  Eigen::Vector2d second_derivative(double t) const;  ///< m per unit of t squared
  /// Direction of travel, rad. Where the curve has no speed (repeated control points) that of the
  /// limit from later t, at the end from earlier t; 0 when all control points are equal.
  double heading(double t) const;
  /// Signed, 1/m, positive to the left. 0 for a single point; where the curve has no speed the
  /// limit, infinite at a cusp.
  double curvature(double t) const;
  /// Arc length between two t, m (Gauss-Legendre on halves until they agree to 1e-9 of the control
  /// polygon's length).
  double length(double from = 0, double to = 1) const;
};

}  // namespace blindcorner
