// SPDX-License-Identifier: Apache-2.0
/// Exact distances between convex polygons in the plane.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace blindcorner {

/// Corners in order, m; two corners are a line, one is a point.
using Polygon = std::vector<Eigen::Vector2d>;

/// Shortest distance between two convex polygons, m; 0 where they touch or overlap.
double convex_distance(const Polygon& a, const Polygon& b);

}  // namespace blindcorner
