// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/path.h"

#include <algorithm>
#include <cmath>

#include "blindcorner/forward/constants.h"

namespace blindcorner {
namespace {

/// Share of the way from a to b at which `position` is nearest to the line between them, 0 to 1.
double nearest_share(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                     const Eigen::Vector2d& position) {
  const Eigen::Vector2d line = b - a;
  const double squared = line.squaredNorm();
  return squared > 0 ? std::clamp((position - a).dot(line) / squared, 0.0, 1.0) : 0;
}

PathPoint between(const PathPoint& a, const PathPoint& b, double share) {
  PathPoint point;
  point.position = a.position + share * (b.position - a.position);
  point.heading = a.heading + share * std::remainder(b.heading - a.heading, 2 * kPi);
  point.curvature = a.curvature + share * (b.curvature - a.curvature);
  point.arc_length = a.arc_length + share * (b.arc_length - a.arc_length);
  return point;
}

}  // namespace

PathPoint Path::at(double arc_length) const {
  const auto after = std::ranges::upper_bound(points, arc_length, {}, &PathPoint::arc_length);
  if (after == points.begin()) return points.front();
  if (after == points.end()) return points.back();
  const PathPoint& before = *std::prev(after);
  return between(before, *after,
                 (arc_length - before.arc_length) / (after->arc_length - before.arc_length));
}

double Path::nearest(const Eigen::Vector2d& position, double from) const {
  double nearest = std::clamp(from, 0.0, points.back().arc_length);
  double least = (at(nearest).position - position).squaredNorm();
  for (std::size_t i = 1; i < points.size(); ++i) {
    const PathPoint &a = points[i - 1], &b = points[i];
    if (b.arc_length <= from) continue;
    const PathPoint candidate = between(a, b, nearest_share(a.position, b.position, position));
    const double distance = (candidate.position - position).squaredNorm();
    if (candidate.arc_length < from || distance >= least) continue;
    least = distance;
    nearest = candidate.arc_length;
  }
  return nearest;
}

}  // namespace blindcorner
