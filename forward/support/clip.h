// SPDX-License-Identifier: Apache-2.0
/// Cutting convex polygons.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace blindcorner {

/// The part of a convex polygon (corners in order) on the inner side of a plane through `at`.
std::vector<Eigen::Vector3d> clip(const std::vector<Eigen::Vector3d>& polygon,
                                  const Eigen::Vector3d& at, const Eigen::Vector3d& inward);

}  // namespace blindcorner
