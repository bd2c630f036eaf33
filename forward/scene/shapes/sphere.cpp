// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "blindcorner/forward/constants.h"
#include "forward/scene/shapes/shape_parts.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// The circle in which the cone of tangents from the point touches the sphere, as an octagon of the
/// same area.
std::vector<Vector3d> disc_seen_from(const Vector3d& point, const Vector3d& center, double radius) {
  const Vector3d way = center - point;
  const double share = std::pow(radius, 2) / way.squaredNorm();
  if (share >= 1) return {};
  const double reach = radius * std::sqrt(1 - share) * std::sqrt(kPi / (2 * std::numbers::sqrt2));
  const Vector3d u = way.unitOrthogonal();
  const Vector3d v = way.normalized().cross(u);
  std::vector<Vector3d> corners;
  // Cosine and sine of an eighth of a half turn.
  constexpr double kNear = 0.92387953251128674, kFar = 0.38268343236508977;
  constexpr std::array<std::array<double, 2>, 8> kCorners{{{kNear, kFar},
                                                           {kFar, kNear},
                                                           {-kFar, kNear},
                                                           {-kNear, kFar},
                                                           {-kNear, -kFar},
                                                           {-kFar, -kNear},
                                                           {kFar, -kNear},
                                                           {kNear, -kFar}}};
  for (const auto& [a, b] : kCorners) {
    corners.emplace_back(point + (1 - share) * way + reach * (a * u + b * v));
  }
  return corners;
}

class Sphere final : public RoundGeometry {
 public:
  explicit Sphere(const SphereShape& shape) : radius_(shape.radius) {}

  const char* name() const override { return "sphere"; }
  Anchor default_anchor() const override { return Anchor::center; }
  double depth() const override { return radius_; }
  double reach(double below) const override { return radius_ + below; }
  Vector3d half_extents(std::optional<double> /*yaw*/) const override {
    return Vector3d::Constant(radius_);
  }

  /// Bands of equal height (equal area), so every cell has the same area. The cell lies in the
  /// tangent plane.
  std::vector<SurfaceCell> cells(double max_edge, int min_divisions) const override {
    const int bands = divisions(kPi * radius_, max_edge, std::max(4, 2 * min_divisions));
    const int around = divisions(2 * kPi * radius_, max_edge, std::max(8, 4 * min_divisions));
    const double area = 4 * kPi * radius_ * radius_ / (bands * around);
    std::vector<SurfaceCell> cells;
    for (int b = 0; b < bands; ++b) {
      const double z = (2 * b + 1.0) / bands - 1;
      const double s = std::sqrt(1 - z * z);
      for (int a = 0; a < around; ++a) {
        const double phi = 2 * kPi * (a + 0.5) / around;
        SurfaceCell cell;
        cell.normal = Vector3d(s * std::cos(phi), s * std::sin(phi), z);
        cell.center = radius_ * cell.normal;
        const Vector3d east(-std::sin(phi), std::cos(phi), 0);
        cell.half_u = east * (kPi * radius_ * s / around);
        cell.half_v = cell.normal.cross(east) * (area / (4 * kPi * radius_ * s / around));
        cell.area = area;
        cells.push_back(cell);
      }
    }
    return cells;
  }

  /// Equal heights have equal areas.
  std::vector<SurfacePoint> points(const PointSpacing& apart) const override {
    const double spacing = apart.least();
    const int around = steps_around(radius_, spacing);
    std::vector<SurfacePoint> points;
    for (const QuadraturePoint& z : gauss_legendre(divisions(kPi * radius_, spacing, 4))) {
      const double s = std::sqrt(1 - z.position * z.position);
      for (int a = 0; a < around; ++a) {
        const double phi = 2 * kPi * (a + 0.5) / around;
        const Vector3d normal(s * std::cos(phi), s * std::sin(phi), z.position);
        points.push_back(
            {radius_ * normal, normal, z.weight * 2 * kPi * radius_ * radius_ / around});
      }
    }
    return points;
  }

  std::vector<Triangle> triangles(int segments) const override {
    const int bands = std::max(4, segments / 2);
    const auto circle = [&](int band) {
      const double latitude = kPi * band / bands - kPi / 2;
      return Circle{radius_ * std::cos(latitude), radius_ * std::sin(latitude)};
    };
    std::vector<Triangle> triangles;
    for (int b = 0; b < bands; ++b) {
      for (int a = 0; a < segments; ++a) {
        add_ring(circle(b), circle(b + 1), a, segments, triangles);
      }
    }
    return triangles;
  }

  Silhouette silhouette(const ShapeFrame& world) const override {
    const Vector3d center = world.T_world_shape.translation();
    const double radius = world.size * radius_;
    return {{}, [center, radius](const Vector3d& point) {
              return disc_seen_from(point, center, radius);
            }};
  }

 private:
  double radius_;  ///< m
};

}  // namespace

std::unique_ptr<const ShapeGeometry> SphereShape::geometry() const {
  return std::make_unique<Sphere>(*this);
}

}  // namespace blindcorner
