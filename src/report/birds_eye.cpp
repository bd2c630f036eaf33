// SPDX-License-Identifier: Apache-2.0
#include "report/birds_eye.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/scene/footprint.h"

namespace blindcorner {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Length to which the field of view is drawn if none of its directions meets a surface, m.
constexpr double kOpenRange = 3.0;
/// Directions along each edge of a zone. Corners alone are not enough: a footprint that crosses
/// from one surface to another has a bend.
constexpr int kZoneDirections = 7;
/// Sectors in which the reach of the field of view is drawn.
constexpr int kSectors = 48;

/// Distance along `direction` to the triangle (Moeller and Trumbore 1997), infinity if missed.
double distance_to(const Triangle& triangle, const Vector3d& origin, const Vector3d& direction) {
  constexpr double kMissed = std::numeric_limits<double>::infinity();
  const Vector3d u = triangle[1] - triangle[0];
  const Vector3d v = triangle[2] - triangle[0];
  const Vector3d p = direction.cross(v);
  const double determinant = u.dot(p);
  if (std::abs(determinant) < 1e-12) return kMissed;
  const Vector3d s = (origin - triangle[0]) / determinant;
  const Vector3d q = s.cross(u);
  const double a = s.dot(p);
  const double b = direction.dot(q);
  const double distance = v.dot(q);
  const bool hit = a >= 0.0 && b >= 0.0 && a + b <= 1.0 && distance > 1e-6;
  return hit ? distance : kMissed;
}

struct Hit {
  Vector3d point;
  std::size_t surface;
};

/// The known surfaces as triangles.
class Surroundings {
 public:
  explicit Surroundings(const Scene& scene) {
    for (const Surface& surface : scene.surfaces) {
      surfaces_.push_back(triangulate(surface.shape, surface.T_world_surface, 1.0));
    }
  }

  std::optional<Hit> first_hit(const Vector3d& origin, const Vector3d& direction) const {
    double nearest = std::numeric_limits<double>::infinity();
    std::size_t surface = 0;
    for (std::size_t s = 0; s < surfaces_.size(); ++s) {
      for (const Triangle& triangle : surfaces_[s]) {
        const double distance = distance_to(triangle, origin, direction);
        if (distance >= nearest) continue;
        nearest = distance;
        surface = s;
      }
    }
    if (!std::isfinite(nearest)) return std::nullopt;
    return Hit{origin + direction * nearest, surface};
  }

 private:
  std::vector<std::vector<Triangle>> surfaces_;
};

/// Unit directions that fill the rectangle, edges included, sensor frame.
std::vector<Vector3d> directions_in(const AngularRectangle& rectangle) {
  std::vector<Vector3d> directions;
  for (int i = 0; i < kZoneDirections; ++i) {
    for (int j = 0; j < kZoneDirections; ++j) {
      const double right = std::lerp(rectangle.left, rectangle.right, i / (kZoneDirections - 1.0));
      const double down = std::lerp(rectangle.top, rectangle.bottom, j / (kZoneDirections - 1.0));
      directions.push_back(Vector3d(1.0, -std::tan(right), -std::tan(down)).normalized());
    }
  }
  return directions;
}

/// Reach of the directions seen, in sectors around the forward direction.
class Fan {
 public:
  Fan(const Vector3d& origin, const Vector3d& forward)
      : origin_(origin.head<2>()), middle_(std::atan2(forward.y(), forward.x())) {}

  void add(const Vector3d& direction, const std::optional<Hit>& hit) {
    const double azimuth =
        std::remainder(std::atan2(direction.y(), direction.x()) - middle_, 2.0 * kPi);
    const double reach = hit ? (hit->point.head<2>() - origin_).norm() : 0.0;
    rays_.push_back({azimuth, reach});
  }

  /// Empty when the field of view spans more than half a turn, as it does for a sensor that looks
  /// down.
  Outline outline() const {
    if (rays_.empty()) return {};
    const auto [first, last] = std::ranges::minmax(rays_, {}, &Ray::azimuth);
    const double span = last.azimuth - first.azimuth;
    if (span <= 0.0 || span > kPi) return {};
    std::vector<double> reach(kSectors + 1, 0.0);
    for (const Ray& ray : rays_) {
      const double sector = (ray.azimuth - first.azimuth) / span * kSectors;
      double& known = reach[static_cast<std::size_t>(std::lround(sector))];
      known = std::max(known, ray.reach);
    }
    Outline outline = {origin_};
    for (std::size_t k = 0; k < reach.size(); ++k) {
      const double azimuth = middle_ + first.azimuth + span * static_cast<double>(k) / kSectors;
      if (reach[k] > 0.0) outline.push_back(origin_ + reach[k] * unit(azimuth));
    }
    if (outline.size() == 1) {
      outline.push_back(origin_ + kOpenRange * unit(middle_ + first.azimuth));
      outline.push_back(origin_ + kOpenRange * unit(middle_ + last.azimuth));
    }
    return outline;
  }

 private:
  struct Ray {
    double azimuth, reach;
  };
  static Vector2d unit(double angle) { return {std::cos(angle), std::sin(angle)}; }

  Vector2d origin_;
  double middle_;
  std::vector<Ray> rays_;
};

}  // namespace

SensorOutlines sensor_outlines(const Scene& scene, const Transform& T_world_sensor,
                               const std::vector<Vector3d>& relay_points) {
  const Surroundings surroundings(scene);
  SensorOutlines view;
  view.position = T_world_sensor.translation();
  view.forward = T_world_sensor.linear() * Vector3d::UnitX();
  Fan fan(view.position, view.forward);
  std::vector<Vector3d> seen = {view.position};
  const std::vector<Zone>& zones = scene.sensor.zones;
  for (std::size_t z = 0; z < zones.size(); ++z) {
    std::map<std::size_t, std::vector<Vector3d>> ends;  // by surface
    if (relay_points.size() == zones.size()) {
      ends[0].push_back(relay_points[z]);
    } else if (const auto* point = std::get_if<Vector3d>(&zones[z].footprint)) {
      if (point->allFinite()) ends[0].push_back(*point);  // else each capture says where
    } else {
      for (const Vector3d& ray : directions_in(std::get<AngularRectangle>(zones[z].footprint))) {
        const Vector3d direction = T_world_sensor.linear() * ray;
        const std::optional<Hit> hit = surroundings.first_hit(view.position, direction);
        fan.add(direction, hit);
        if (hit) ends[hit->surface].push_back(hit->point);
      }
    }
    view.zones.emplace_back();
    for (const auto& [surface, points] : ends) {
      view.zones.back().push_back(hull_from_above(points));
      seen.insert(seen.end(), points.begin(), points.end());
    }
  }
  view.field_of_view = fan.outline();
  if (view.field_of_view.empty()) view.field_of_view = hull_from_above(seen);
  return view;
}

}  // namespace blindcorner
