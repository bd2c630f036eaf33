// SPDX-License-Identifier: Apache-2.0
/// A path as controllers read it.
#pragma once

#include <Eigen/Core>
#include <span>

namespace blindcorner {

/// One of the points along a path; lists of them are in order of arc length, which grows.
struct PathSample {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  ///< m
  double heading = 0;                                  ///< rad
  double curvature = 0;                                ///< 1/m; to the left is positive
  double arc_length = 0;                               ///< from the path's start, m
};

/// Between two samples of a path; clamped to its ends. Headings may be wrapped.
PathSample path_at(std::span<const PathSample> path, double arc_length);

/// Arc length of the path's point nearest to `position`, looked for within [from, to].
double nearest_arc_length(std::span<const PathSample> path, const Eigen::Vector2d& position,
                          double from, double to);

}  // namespace blindcorner
