// SPDX-License-Identifier: Apache-2.0
/// Area of the plan view that a body covers.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "blindcorner/forward/scene/shape.h"

namespace blindcorner {

/// Corners of a convex polygon in x and y, m, counter-clockwise. A body seen edge-on has two
/// corners.
using Footprint = std::vector<Eigen::Vector2d>;

/// Convex hull of points seen from above.
Footprint hull_from_above(const std::vector<Eigen::Vector3d>& points);

/// Convex hull of a placed shape seen from above. A circle becomes a polygon with 48 corners on the
/// circle.
Footprint footprint(const Shape& shape, const Transform& T_world_shape, double size = 1.0);

/// The same for a shape whose anchor is placed, in world coordinates. The footprint of any
/// placement is the footprint of `Placement{}`, scaled by the placement's size, turned by its yaw
/// and moved to its position.
Footprint footprint(const Shape& shape, Anchor anchor, const Placement& placement);

}  // namespace blindcorner
