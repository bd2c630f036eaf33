// SPDX-License-Identifier: Apache-2.0
/// The curve that paths are smoothed with.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "blindcorner/planner/path/bezier.h"

namespace blindcorner {

/// Bezier pieces of the uniform cubic B-spline of these control points, 2 or more. The ends are
/// prolonged by mirrored points, so that the curve begins at the first control point, towards the
/// second one and without curvature, and ends likewise. One piece fewer than control points.
/// `start_bend` is added to the point that is mirrored at the start: the curve begins with it as
/// its second derivative by the number of the control point, and a sixth of it from the first one.
std::vector<CubicBezier> spline_pieces(std::span<const Eigen::Vector2d> control,
                                       const Eigen::Vector2d& start_bend = {0, 0});

/// Control points of the same curve with half the spacing: one more between any two. `start_bend`
/// becomes a quarter of what it was.
std::vector<Eigen::Vector2d> subdivided(std::span<const Eigen::Vector2d> control,
                                        const Eigen::Vector2d& start_bend = {0, 0});

/// Control points p that minimise sum |p[i-1] - 2 p[i] + p[i+1]|^2 + sum w[i] |p[i] - q[i]|^2. All
/// weights are > 0; 2 or more points.
std::vector<Eigen::Vector2d> flattened(std::span<const Eigen::Vector2d> targets,
                                       std::span<const double> weights);

/// `count` points, 2 or more, evenly spaced along straight lines through `corners`, ends included.
std::vector<Eigen::Vector2d> evenly_spaced(std::span<const Eigen::Vector2d> corners,
                                           std::size_t count);

/// Length of the straight lines through `corners`, m.
double polyline_length(std::span<const Eigen::Vector2d> corners);

}  // namespace blindcorner
