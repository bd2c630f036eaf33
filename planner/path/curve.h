// SPDX-License-Identifier: Apache-2.0
/// Curves whose curvature changes linearly from node to node: chains of clothoids.
#pragma once

#include <optional>
#include <vector>

#include "blindcorner/planner/path/path.h"

namespace blindcorner {

/// The pose `length` m farther, on a clothoid that ends with `curvature` (1/m).
PathPoint advanced(const PathPoint& from, double curvature, double length);

/// Where a curve is to end.
struct CurveEnd {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  ///< m
  std::optional<double> heading;                       ///< rad; none: any
};

struct Curve {
  PathPoint start;                ///< its arc length is 0; its curvature is that of the first node
  double spacing = 1;             ///< m of arc length between nodes
  double length = 0;              ///< m; the last node is not before it
  std::vector<double> curvature;  ///< [nodes] 1/m, two or more

  double curvature_at(double arc_length) const;
  /// Points at most `spacing` m apart, first and last those of the curve.
  std::vector<PathPoint> points(double spacing) const;
};

/// A curve near `curve` that ends where `end` says and whose curvature has small second
/// differences. At a `weight` of 0 these do not count; at 1, bends shorter than six nodes
/// disappear. The start stays the same. The end is met up to the error that a few Newton steps
/// leave.
Curve fitted(const Curve& curve, const CurveEnd& end, double weight);

}  // namespace blindcorner
