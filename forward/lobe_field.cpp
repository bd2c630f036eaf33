// SPDX-License-Identifier: Apache-2.0
#include "lobe_field.h"

#include <Eigen/Geometry>
#include <array>
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/relay.h"
#include "blindcorner/forward/shape.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Beyond this many standard deviations an edge is out of the lobe's reach.
constexpr double kReach = 4;
/// Corners of the polygon that stands for a cone, of its area.
constexpr int kConeCorners = 32;

/// Density and distribution function of the standard normal distribution.
struct Normal {
  double density, below;
};

/// From a table with linear interpolation: errors below 4e-5.
Normal normal_at(double x) {
  constexpr int kSteps = 400;
  static const auto table = [] {
    std::array<Normal, kSteps + 2> t{};
    for (int i = 0; i < kSteps + 2; ++i) {
      const double at = kReach * (2.0 * i / kSteps - 1);
      t[static_cast<std::size_t>(i)] = {std::exp(-0.5 * at * at) / std::sqrt(2 * kPi),
                                        0.5 * std::erfc(-at / std::sqrt(2.0))};
    }
    return t;
  }();
  if (x >= kReach) return {0, 1};
  if (x <= -kReach) return {0, 0};
  const double position = (x / kReach + 1) * kSteps / 2;
  const auto i = static_cast<std::size_t>(position);
  const double t = position - static_cast<double>(i);
  return {table[i].density * (1 - t) + table[i + 1].density * t,
          table[i].below * (1 - t) + table[i + 1].below * t};
}

/// Corners of a field's directions in the sensor's frame, in order.
std::vector<Vector3d> corners_of(const FieldOfIllumination& field) {
  if (const auto* r = std::get_if<AngularRectangle>(&field)) {
    const auto corner = [](double right, double down) {
      return direction_from_tangents(std::tan(right), std::tan(down));
    };
    return {corner(r->left, r->top), corner(r->right, r->top), corner(r->right, r->bottom),
            corner(r->left, r->bottom)};
  }
  const double step = 2 * kPi / kConeCorners;
  const double tangent =
      std::tan(std::get<AngularCone>(field).half_angle) * std::sqrt(step / std::sin(step));
  std::vector<Vector3d> corners;
  for (int i = 0; i < kConeCorners; ++i) {
    corners.push_back(
        direction_from_tangents(tangent * std::cos(i * step), tangent * std::sin(i * step)));
  }
  return corners;
}

/// The part of a polygon on the inner side of a plane through `apex`.
std::vector<Vector3d> clip(const std::vector<Vector3d>& polygon, const Vector3d& apex,
                           const Vector3d& inward) {
  std::vector<Vector3d> kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vector3d& p = polygon[i];
    const Vector3d& q = polygon[(i + 1) % polygon.size()];
    const double fp = inward.dot(p - apex);
    const double fq = inward.dot(q - apex);
    if (fp >= 0) kept.push_back(p);
    if ((fp >= 0) != (fq >= 0)) kept.push_back(p + fp / (fp - fq) * (q - p));
  }
  return kept;
}

}  // namespace

void Strip::cut(bool upper, double distance) {
  const Normal n = normal_at(distance);
  double& share = upper ? high : low;
  double& density = upper ? high_density : low_density;
  double& slope = upper ? high_slope : low_slope;
  // Several edges on one side: a product of shares.
  density = density * n.below + share * n.density;
  slope = slope * n.below + share * n.density * distance;
  share *= n.below;
}

double Strip::mean() const { return (low_density - high_density) / share(); }

double Strip::variance() const {
  const double m = mean();
  return std::max(1 - (low_slope + high_slope) / share() - m * m, 0.0);
}

LobeField::LobeField(const Scene& scene, const SensorPlacement& placement)
    : source_(placement.T_world_sensor * scene.sensor.light_offset),
      sigma_(std::get<RetroreflectiveMaterial>(scene.hidden.material).lobe_sigma),
      intensity_(scene.sensor.radiant_intensity) {
  const auto add = [&](const FieldOfIllumination& field, int zone) {
    std::vector<Vector3d> rays = corners_of(field);
    Vector3d middle = Vector3d::Zero();
    for (Vector3d& ray : rays) {
      ray = placement.T_world_sensor.linear() * ray;
      middle += ray;
    }
    for (const Surface& surface : scene.surfaces) {
      if (!surface.relay || surface.albedo <= 0) continue;
      const bool closed = std::holds_alternative<BoxShape>(surface.shape);
      for (const auto& quad : flat_faces(surface.shape, surface.T_world_surface, 1.0)) {
        LitPolygon lit;
        lit.zone = zone;
        lit.albedo = surface.albedo;
        lit.normal = (quad[1] - quad[0]).cross(quad[3] - quad[0]).normalized();
        if (closed && lit.normal.dot(source_ - quad[0]) <= 0) continue;
        lit.corners.assign(quad.begin(), quad.end());
        for (std::size_t i = 0; i < rays.size() && lit.corners.size() > 2; ++i) {
          Vector3d inward = rays[i].cross(rays[(i + 1) % rays.size()]);
          if (inward.dot(middle) < 0) inward = -inward;
          lit.corners = clip(lit.corners, source_, inward.normalized());
        }
        if (lit.corners.size() > 2) polygons_.push_back(std::move(lit));
      }
    }
  };
  const Sensor& sensor = scene.sensor;
  if (sensor.illumination == Illumination::flash) {
    add(sensor.field, -1);
    return;
  }
  for (int z = 0; z < sensor.zone_count(); ++z) {
    const auto& footprint = sensor.zones[static_cast<std::size_t>(z)].footprint;
    if (const auto* r = std::get_if<AngularRectangle>(&footprint)) add(*r, z);
  }
}

void LobeField::View::add_edges(const std::vector<Vector3d>& corners, Polygon& polygon) {
  Vector3d center = Vector3d::Zero();
  for (const Vector3d& c : corners) center += c;
  center /= static_cast<double>(corners.size());
  polygon.first = edges_.size();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    Vector3d inward = (corners[i] - origin_).cross(corners[(i + 1) % corners.size()] - origin_);
    const double length = inward.norm();
    if (!(length > 0)) continue;
    inward /= inward.dot(center - origin_) < 0 ? -length : length;
    edges_.push_back({inward});
  }
  polygon.end = edges_.size();
}

LobeField::View LobeField::seen_from(const Vector3d& origin,
                                     const std::vector<OccluderFace>& occluders) const {
  View view;
  view.origin_ = origin;
  view.source_ = source_;
  view.sigma_ = sigma_;
  view.intensity_ = intensity_;
  for (const LitPolygon& lit : polygons_) {
    const double side = lit.normal.dot(origin - lit.corners.front());
    // Light has to fall on the side that the object sees.
    if (side * lit.normal.dot(source_ - lit.corners.front()) <= 0) continue;
    View::Polygon polygon{lit.zone, lit.albedo, lit.normal, lit.corners.front(), 0, 0};
    view.add_edges(lit.corners, polygon);
    view.polygons_.push_back(polygon);
  }
  for (const OccluderFace& face : occluders) {
    const std::vector<Vector3d> corners(face.corners.begin(), face.corners.end());
    const Vector3d normal = (corners[1] - corners[0]).cross(corners[3] - corners[0]).normalized();
    const double side = normal.dot(origin - corners[0]);
    if (std::abs(side) < 1e-9 || (face.one_sided && side < 0)) continue;
    View::Polygon polygon{-1, 0.0, normal, corners[0], 0, 0};
    view.add_edges(corners, polygon);
    view.occluders_.push_back(polygon);
  }
  return view;
}

/// Cuts the lobe by a polygon's edges; false when nothing of it is left.
bool LobeField::View::cut(const Polygon& polygon, const Vector3d& direction, const Vector3d& along,
                          const Vector3d& across, Strip& strip_along, Strip& strip_across) const {
  for (std::size_t e = polygon.first; e < polygon.end; ++e) {
    const Vector3d& inward = edges_[e].inward;
    const double distance = inward.dot(direction) / sigma_;
    if (distance >= kReach) continue;
    if (distance <= -kReach) return false;
    const double a = inward.dot(along);
    const double c = inward.dot(across);
    if (std::abs(a) >= std::abs(c)) {
      strip_along.cut(a < 0, distance);
    } else {
      strip_across.cut(c < 0, distance);
    }
  }
  return true;
}

/// Share of the lobe that faces nearer than `distance` hide.
double LobeField::View::hidden_share(const Vector3d& direction, double distance,
                                     const Vector3d& along, const Vector3d& across) const {
  double visible = 1;
  for (const Polygon& face : occluders_) {
    const double slope = face.normal.dot(direction);
    const double t = face.normal.dot(face.point - origin_) / slope;
    if (!(t > 0) || t > distance) continue;
    Strip strip_along;
    Strip strip_across;
    if (cut(face, direction, along, across, strip_along, strip_across)) {
      visible *= 1 - strip_along.share() * strip_across.share();
    }
  }
  return 1 - visible;
}

GatheredLight LobeField::View::about(const Vector3d& direction, int zone) const {
  GatheredLight light;
  for (const Polygon& polygon : polygons_) {
    if (polygon.zone >= 0 && polygon.zone != zone) continue;
    Vector3d along = polygon.normal - polygon.normal.dot(direction) * direction;
    const double tilt = along.norm();
    along = tilt > 1e-9 ? Vector3d(along / tilt) : direction.unitOrthogonal();
    const Vector3d across = direction.cross(along);
    Strip strip_along;
    Strip strip_across;
    if (!cut(polygon, direction, along, across, strip_along, strip_across)) continue;
    const double share = strip_along.share() * strip_across.share();
    if (share < 1e-5) continue;
    const double spread = std::sqrt(strip_along.variance());
    const double shift = strip_along.mean();
    const double distance =
        polygon.normal.dot(polygon.point - origin_) / polygon.normal.dot(direction);
    const double visible =
        occluders_.empty() ? 1.0 : 1 - hidden_share(direction, distance, along, across);
    const Vector3d sideways = sigma_ * strip_across.mean() * across;
    for (const double sign : {-1.0, 1.0}) {
      const Vector3d ray = direction + sideways + sigma_ * (shift + sign * spread) * along;
      const double slope = polygon.normal.dot(ray);
      const double t = polygon.normal.dot(polygon.point - origin_) / slope;
      if (!(t > 0) || !std::isfinite(t)) continue;
      const Vector3d p = origin_ + t * ray;
      const Vector3d from = p - source_;
      const double d = from.norm();
      const double cosine = std::abs(polygon.normal.dot(from)) / d;
      const double radiance = intensity_ * polygon.albedo / kPi * cosine / (d * d);
      const double weight = 0.5 * share * visible * radiance;
      const double r = (p - origin_).norm();
      const double path = d + r;
      // Across the tilt a turn moves p by r at right angles to the ray.
      const double change = sigma_ * r * across.dot(from) / d;
      light.weight += weight;
      light.first += weight * path;
      light.second += weight * (path * path + change * change * strip_across.variance());
    }
  }
  return light;
}

}  // namespace blindcorner
