// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "forward/scene/shapes/shape_parts.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// The upright rectangle between the tangents from the point to the cylinder's side. What the caps
/// hide beyond it, seen from above or below, is left out.
std::vector<Vector3d> side_seen_from(const Vector3d& point, const Vector3d& center, double radius,
                                     double half_height) {
  Vector3d way = center - point;
  way.z() = 0;
  const double share = std::pow(radius, 2) / way.squaredNorm();
  if (!(share < 1)) return {};
  const Vector3d across =
      radius * std::sqrt(1 - share) * Vector3d(-way.y(), way.x(), 0).normalized();
  const Vector3d up(0, 0, half_height);
  const Vector3d middle = center - share * way;
  return {middle - across - up, middle + across - up, middle + across + up, middle - across + up};
}

class Cylinder final : public RoundGeometry {
 public:
  explicit Cylinder(const CylinderShape& shape)
      : radius_(shape.radius), height_(shape.height), half_(shape.height / 2) {}

  const char* name() const override { return "cylinder"; }
  Anchor default_anchor() const override { return Anchor::base; }
  double depth() const override { return half_; }
  double reach(double below) const override { return std::hypot(radius_, half_ + below); }
  Vector3d half_extents(std::optional<double> /*yaw*/) const override {
    return {radius_, radius_, half_};
  }

  std::vector<SurfaceCell> cells(double max_edge, int min_divisions) const override {
    std::vector<SurfaceCell> cells;
    const int around = divisions(2 * kPi * radius_, max_edge, std::max(12, 4 * min_divisions));
    add_side_cells(around, divisions(height_, max_edge, min_divisions), cells);
    const int rings = divisions(radius_, max_edge, min_divisions);
    for (const double side : {1.0, -1.0}) {
      for (int k = 0; k < rings; ++k) {
        add_cap_ring(side, radius_ * k / rings, radius_ * (k + 1) / rings,
                     std::max(4, around / (rings - k)), cells);
      }
    }
    return cells;
  }

  std::vector<SurfacePoint> points(const PointSpacing& spacing) const override {
    std::vector<SurfacePoint> points;
    const int around = steps_around(radius_, spacing.across);
    for (int a = 0; a < around; ++a) {
      const double phi = 2 * kPi * (a + 0.5) / around;
      const Vector3d normal(std::cos(phi), std::sin(phi), 0);
      for (const QuadraturePoint& z : rule_along(height_, spacing.up)) {
        points.push_back({radius_ * normal + Vector3d(0, 0, half_ * z.position), normal,
                          2 * kPi * radius_ / around * half_ * z.weight});
      }
    }
    // Caps: equal steps of the squared radius have equal areas.
    for (const double side : {1.0, -1.0}) {
      for (const QuadraturePoint& square : rule_along(radius_, spacing.across)) {
        const double r = radius_ * std::sqrt(0.5 * (1 + square.position));
        const int sectors = steps_around(r, spacing.across);
        for (int a = 0; a < sectors; ++a) {
          const double phi = 2 * kPi * (a + 0.5) / sectors;
          points.push_back({Vector3d(r * std::cos(phi), r * std::sin(phi), side * half_),
                            Vector3d(0, 0, side),
                            kPi * radius_ * radius_ * 0.5 * square.weight / sectors});
        }
      }
    }
    return points;
  }

  std::vector<Triangle> triangles(int segments) const override {
    std::vector<Triangle> triangles;
    const Circle bottom{radius_, -half_};
    const Circle top{radius_, half_};
    for (int a = 0; a < segments; ++a) {
      add_ring(bottom, top, a, segments, triangles);
      triangles.push_back(
          {Vector3d(0, 0, half_), point_on(top, a, segments), point_on(top, a + 1, segments)});
      triangles.push_back({Vector3d(0, 0, -half_), point_on(bottom, a + 1, segments),
                           point_on(bottom, a, segments)});
    }
    return triangles;
  }

  Silhouette silhouette(const ShapeFrame& world) const override {
    const Vector3d center = world.T_world_shape.translation();
    const double radius = world.size * radius_;
    const double half = world.size * height_ / 2;
    return {{}, [center, radius, half](const Vector3d& point) {
              return side_seen_from(point, center, radius, half);
            }};
  }

 private:
  void add_side_cells(int around, int up, std::vector<SurfaceCell>& cells) const {
    SurfaceCell cell;
    cell.half_v = Vector3d(0, 0, height_ / (2 * up));
    cell.area = 2 * kPi * radius_ / around * height_ / up;
    for (int a = 0; a < around; ++a) {
      const double phi = 2 * kPi * (a + 0.5) / around;
      cell.normal = Vector3d(std::cos(phi), std::sin(phi), 0);
      cell.half_u = Vector3d(-std::sin(phi), std::cos(phi), 0) * (kPi * radius_ / around);
      for (int k = 0; k < up; ++k) {
        cell.center = radius_ * cell.normal + Vector3d(0, 0, height_ * ((k + 0.5) / up - 0.5));
        cells.push_back(cell);
      }
    }
  }

  /// Adds the cells of one ring of a cap, one for each sector. All rings have the same width.
  void add_cap_ring(double side, double inner, double outer, int sectors,
                    std::vector<SurfaceCell>& cells) const {
    // Centroid of an annular sector.
    const double half_angle = kPi / sectors;
    const double centroid = 2.0 / 3.0 * std::sin(half_angle) / half_angle *
                            (outer * outer + outer * inner + inner * inner) / (outer + inner);
    SurfaceCell cell;
    cell.normal = Vector3d(0, 0, side);
    cell.area = kPi * (outer * outer - inner * inner) / sectors;
    for (int a = 0; a < sectors; ++a) {
      const double phi = 2 * kPi * (a + 0.5) / sectors;
      const Vector3d radial(std::cos(phi), std::sin(phi), 0);
      cell.center = centroid * radial + Vector3d(0, 0, side * half_);
      cell.half_u = radial * ((outer - inner) / 2);
      cell.half_v = Vector3d(-radial.y(), radial.x(), 0) * (side * half_angle * centroid);
      cells.push_back(cell);
    }
  }

  double radius_, height_, half_;  ///< m; half_ is half the height
};

}  // namespace

std::unique_ptr<const ShapeGeometry> CylinderShape::geometry() const {
  return std::make_unique<Cylinder>(*this);
}

}  // namespace blindcorner
