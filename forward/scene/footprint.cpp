// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/scene/footprint.h"

#include <algorithm>
#include <iterator>

namespace blindcorner {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

Footprint half_hull(const std::vector<Vector2d>& sorted) {
  Footprint chain;
  for (const Vector2d& point : sorted) {
    while (chain.size() >= 2 &&
           cross(chain.back() - chain[chain.size() - 2], point - chain[chain.size() - 2]) <= 0.0) {
      chain.pop_back();
    }
    chain.push_back(point);
  }
  return chain;
}

}  // namespace

Footprint hull_from_above(const std::vector<Vector3d>& points) {
  std::vector<Vector2d> sorted;
  for (const Vector3d& point : points) sorted.emplace_back(point.x(), point.y());
  std::ranges::sort(sorted, [](const Vector2d& a, const Vector2d& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  if (sorted.size() < 3) return sorted;
  Footprint lower = half_hull(sorted);
  std::ranges::reverse(sorted);
  const Footprint upper = half_hull(sorted);
  lower.pop_back();
  lower.insert(lower.end(), upper.begin(), std::prev(upper.end()));
  return lower;
}

Footprint footprint(const Shape& shape, const Transform& T_world_shape, double size) {
  std::vector<Vector3d> corners;
  for (const Triangle& triangle : triangulate(shape, T_world_shape, size)) {
    corners.insert(corners.end(), triangle.begin(), triangle.end());
  }
  return hull_from_above(corners);
}

Footprint footprint(const Shape& shape, Anchor anchor, const Placement& placement) {
  return footprint(shape, object_to_world(shape, anchor, placement), placement.size);
}

}  // namespace blindcorner
