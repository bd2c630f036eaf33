// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/control/path_sample.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "blindcorner/forward/constants.h"

namespace blindcorner {

PathSample path_at(std::span<const PathSample> path, double arc_length) {
  const auto after =
      std::upper_bound(path.begin(), path.end(), arc_length,
                       [](double s, const PathSample& sample) { return s < sample.arc_length; });
  if (after == path.begin()) return path.front();
  if (after == path.end()) return path.back();
  const PathSample& a = *(after - 1);
  const PathSample& b = *after;
  const double t = (arc_length - a.arc_length) / (b.arc_length - a.arc_length);
  return {.position = a.position + t * (b.position - a.position),
          .heading = a.heading + t * std::remainder(b.heading - a.heading, 2 * kPi),
          .curvature = a.curvature + t * (b.curvature - a.curvature),
          .arc_length = arc_length};
}

double nearest_arc_length(std::span<const PathSample> path, const Eigen::Vector2d& position,
                          double from, double to) {
  double nearest = from;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i + 1 < path.size(); ++i) {
    const PathSample& a = path[i];
    const PathSample& b = path[i + 1];
    const double length = b.arc_length - a.arc_length;
    if (length <= 0 || b.arc_length < from || a.arc_length > to) continue;
    const Eigen::Vector2d along = b.position - a.position;
    const double share = along.dot(position - a.position) / std::max(along.squaredNorm(), 1e-12);
    const double low = std::max(0.0, (from - a.arc_length) / length);
    const double high = std::min(1.0, (to - a.arc_length) / length);
    const double t = std::clamp(share, low, std::max(low, high));
    const double distance = (a.position + t * along - position).squaredNorm();
    if (distance < least) least = distance, nearest = a.arc_length + t * length;
  }
  return nearest;
}

}  // namespace blindcorner
