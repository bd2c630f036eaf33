// SPDX-License-Identifier: Apache-2.0
#include "forward/scene/shapes/shape_parts.h"

#include <algorithm>
#include <cmath>

#include "blindcorner/forward/constants.h"

namespace blindcorner {

using Eigen::Vector3d;

int divisions(double edge, double max_edge, int min_divisions) {
  return std::max(min_divisions, static_cast<int>(std::ceil(edge / max_edge - 1e-9)));
}

const std::vector<QuadraturePoint>& rule_along(double length, double spacing) {
  return gauss_legendre(divisions(length, spacing, 1));
}

void add_triangles(const Quad& quad, std::vector<Triangle>& triangles) {
  triangles.push_back({quad[0], quad[1], quad[2]});
  triangles.push_back({quad[0], quad[2], quad[3]});
}

// --- Flat sides --------------------------------------------------------------------------------

Vector3d FlatGeometry::half_extents(std::optional<double> yaw) const {
  const Vector3d half = half_edges();
  if (!yaw) return {std::hypot(half.x(), half.y()), std::hypot(half.x(), half.y()), half.z()};
  const double c = std::abs(std::cos(*yaw));
  const double s = std::abs(std::sin(*yaw));
  return {c * half.x() + s * half.y(), s * half.x() + c * half.y(), half.z()};
}

std::vector<SurfaceCell> FlatGeometry::cells(double max_edge, int min_divisions) const {
  std::vector<SurfaceCell> cells;
  for (const auto& [center, half_u, half_v] : sides()) {
    const int nu = divisions(2 * half_u.norm(), max_edge, min_divisions);
    const int nv = divisions(2 * half_v.norm(), max_edge, min_divisions);
    SurfaceCell cell;
    cell.half_u = half_u / nu;
    cell.half_v = half_v / nv;
    const Vector3d cross = cell.half_u.cross(cell.half_v);
    cell.area = 4 * cross.norm();
    cell.normal = cross.normalized();
    for (int v = 0; v < nv; ++v) {
      for (int u = 0; u < nu; ++u) {
        cell.center =
            center + half_u * ((2 * u + 1.0) / nu - 1) + half_v * ((2 * v + 1.0) / nv - 1);
        cells.push_back(cell);
      }
    }
  }
  return cells;
}

std::vector<SurfacePoint> FlatGeometry::points(const PointSpacing& spacing) const {
  std::vector<SurfacePoint> points;
  const auto rule = [&](const Vector3d& half) {
    const bool upright = std::abs(half.z()) > std::hypot(half.x(), half.y());
    return rule_along(2 * half.norm(), upright ? spacing.up : spacing.across);
  };
  for (const auto& [center, half_u, half_v] : sides()) {
    const Vector3d cross = half_u.cross(half_v);
    for (const QuadraturePoint& v : rule(half_v)) {
      for (const QuadraturePoint& u : rule(half_u)) {
        points.push_back({center + u.position * half_u + v.position * half_v, cross.normalized(),
                          u.weight * v.weight * cross.norm()});
      }
    }
  }
  return points;
}

std::vector<Triangle> FlatGeometry::triangles(int /*segments*/) const {
  const Transform own = Transform::Identity();
  std::vector<Triangle> triangles;
  for (const Quad& quad : silhouette({own, 1.0}).faces) add_triangles(quad, triangles);
  return triangles;
}

Silhouette FlatGeometry::silhouette(const ShapeFrame& world) const {
  Silhouette silhouette;
  for (const auto& [c, u, v] : sides()) {
    const auto corner = [&, &c = c, &u = u, &v = v](double su, double sv) {
      return world(c + su * u + sv * v);
    };
    silhouette.faces.push_back({corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)});
  }
  return silhouette;
}

// --- Round bodies ------------------------------------------------------------------------------

int RoundGeometry::steps_around(double radius, double spacing) {
  return divisions(2 * kPi * radius, spacing, 8);
}

Vector3d RoundGeometry::point_on(const Circle& circle, int a, int segments) {
  const double phi = 2 * kPi * a / segments;
  return {circle.radius * std::cos(phi), circle.radius * std::sin(phi), circle.z};
}

void RoundGeometry::add_ring(const Circle& low, const Circle& high, int a, int segments,
                             std::vector<Triangle>& triangles) {
  add_triangles({point_on(low, a, segments), point_on(low, a + 1, segments),
                 point_on(high, a + 1, segments), point_on(high, a, segments)},
                triangles);
}

}  // namespace blindcorner
