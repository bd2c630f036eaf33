// SPDX-License-Identifier: Apache-2.0
#include "simulation/convex_distance.h"

#include <algorithm>
#include <limits>

namespace blindcorner {
namespace {

using Eigen::Vector2d;

double distance_to_edge(const Vector2d& point, const Vector2d& from, const Vector2d& to) {
  const Vector2d way = to - from;
  const double square = way.squaredNorm();
  const double at = square > 0 ? std::clamp((point - from).dot(way) / square, 0.0, 1.0) : 0.0;
  return (point - from - at * way).norm();
}

double corners_to_edges(const Polygon& corners, const Polygon& edges) {
  double least = std::numeric_limits<double>::infinity();
  for (const Vector2d& corner : corners) {
    for (std::size_t i = 0; i < edges.size(); ++i) {
      least = std::min(least, distance_to_edge(corner, edges[i], edges[(i + 1) % edges.size()]));
    }
  }
  return least;
}

/// Whether the direction at right angles to one of a's edges separates the two polygons. The
/// direction along an edge is tried as well, because a line's ends count as edges too.
bool separated_by_edges(const Polygon& a, const Polygon& b) {
  const auto range = [](const Polygon& polygon, const Vector2d& axis) {
    const auto [low, high] =
        std::ranges::minmax(polygon, {}, [&](const Vector2d& p) { return axis.dot(p); });
    return std::pair(axis.dot(low), axis.dot(high));
  };
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Vector2d edge = a[(i + 1) % a.size()] - a[i];
    for (const Vector2d& axis : {Vector2d(-edge.y(), edge.x()), edge}) {
      const auto [a_low, a_high] = range(a, axis);
      const auto [b_low, b_high] = range(b, axis);
      if (a_high < b_low || b_high < a_low) return true;
    }
  }
  return false;
}

}  // namespace

double convex_distance(const Polygon& a, const Polygon& b) {
  if (!separated_by_edges(a, b) && !separated_by_edges(b, a)) return 0;
  return std::min(corners_to_edges(a, b), corners_to_edges(b, a));
}

}  // namespace blindcorner
