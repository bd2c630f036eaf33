// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/path.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "blindcorner/forward/constants.h"
#include "blindcorner/planner/vehicles/vehicle_state.h"

namespace blindcorner {
namespace {

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

}  // namespace

PlanarPose body_on_path(const VehicleFootprint& body, const PathPoint& place) {
  return {place.position, yaw_on_path(place.heading, place.curvature, body.rear_axle())};
}

PathPoint path_at(std::span<const PathPoint> points, double arc_length) {
  const auto after = std::ranges::upper_bound(points, arc_length, {}, &PathPoint::arc_length);
  if (after == points.begin()) return points.front();
  if (after == points.end()) return points.back();
  const PathPoint& a = *std::prev(after);
  const PathPoint& b = *after;
  const double share = (arc_length - a.arc_length) / (b.arc_length - a.arc_length);
  return {.position = a.position + share * (b.position - a.position),
          .heading = a.heading + share * std::remainder(b.heading - a.heading, 2 * kPi),
          .curvature = a.curvature + share * (b.curvature - a.curvature),
          .arc_length = arc_length};
}

double nearest_arc_length(std::span<const PathPoint> points, const Eigen::Vector2d& position,
                          double from, double to) {
  double nearest = std::clamp(from, points.front().arc_length, points.back().arc_length);
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const PathPoint &a = points[i], &b = points[i + 1];
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

std::optional<double> PathGoal::crossing(const Eigen::Vector2d& from,
                                         const Eigen::Vector2d& to) const {
  if (!line_to) return std::nullopt;
  const Eigen::Vector2d way = to - from, line = *line_to - point;
  const double turn = cross(way, line);
  if (turn == 0) return std::nullopt;
  const double share = cross(point - from, line) / turn;
  const double place = cross(point - from, way) / turn;
  const bool meets = share >= 0 && share <= 1 && place >= 0 && place <= 1;
  return meets ? std::optional(share) : std::nullopt;
}

double Path::greatest_curvature() const {
  double most = 0;
  for (const PathPoint& p : points) most = std::max(most, std::abs(p.curvature));
  return most;
}

}  // namespace blindcorner
