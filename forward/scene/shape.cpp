// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/scene/shape.h"

#include <algorithm>
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "forward/support/overloaded.h"
#include "forward/transport/gauss_legendre.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

int divisions(double edge, double max_edge, int min_divisions) {
  return std::max(min_divisions, static_cast<int>(std::ceil(edge / max_edge - 1e-9)));
}

/// Divides the parallelogram center +- half_u +- half_v; normal = u x v.
void divide_flat(const Vector3d& center, const Vector3d& half_u, const Vector3d& half_v,
                 double max_edge, int min_divisions, std::vector<SurfaceCell>& cells) {
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
      cell.center = center + half_u * ((2 * u + 1.0) / nu - 1) + half_v * ((2 * v + 1.0) / nv - 1);
      cells.push_back(cell);
    }
  }
}

/// The six faces of a box as (centre, half_u, half_v) with outward u x v.
std::array<std::array<Vector3d, 3>, 6> box_faces(const Vector3d& size) {
  std::array<std::array<Vector3d, 3>, 6> faces;
  const Vector3d h = size / 2;
  for (int axis = 0; axis < 3; ++axis) {
    const int b = (axis + 1) % 3;
    const int c = (axis + 2) % 3;
    for (int side = 0; side < 2; ++side) {
      const double sign = side == 0 ? 1 : -1;
      faces[static_cast<std::size_t>(2 * axis + side)] = {
          Vector3d(Vector3d::Unit(axis) * (sign * h[axis])), Vector3d(Vector3d::Unit(b) * h[b]),
          Vector3d(Vector3d::Unit(c) * (sign * h[c]))};
    }
  }
  return faces;
}

/// Sphere in bands of equal height (equal area), so every cell has the same area. The cell lies in
/// the tangent plane.
void divide_sphere(double radius, double max_edge, int min_divisions,
                   std::vector<SurfaceCell>& cells) {
  const int bands = divisions(kPi * radius, max_edge, std::max(4, 2 * min_divisions));
  const int around = divisions(2 * kPi * radius, max_edge, std::max(8, 4 * min_divisions));
  const double area = 4 * kPi * radius * radius / (bands * around);
  for (int b = 0; b < bands; ++b) {
    const double z = (2 * b + 1.0) / bands - 1;
    const double s = std::sqrt(1 - z * z);
    for (int a = 0; a < around; ++a) {
      const double phi = 2 * kPi * (a + 0.5) / around;
      SurfaceCell cell;
      cell.normal = Vector3d(s * std::cos(phi), s * std::sin(phi), z);
      cell.center = radius * cell.normal;
      const Vector3d east(-std::sin(phi), std::cos(phi), 0);
      cell.half_u = east * (kPi * radius * s / around);
      cell.half_v = cell.normal.cross(east) * (area / (4 * kPi * radius * s / around));
      cell.area = area;
      cells.push_back(cell);
    }
  }
}

void divide_cylinder(const CylinderShape& shape, double max_edge, int min_divisions,
                     std::vector<SurfaceCell>& cells) {
  const double r = shape.radius;
  const int around = divisions(2 * kPi * r, max_edge, std::max(12, 4 * min_divisions));
  const int up = divisions(shape.height, max_edge, min_divisions);
  SurfaceCell cell;
  cell.half_v = Vector3d(0, 0, shape.height / (2 * up));
  cell.area = 2 * kPi * r / around * shape.height / up;
  for (int a = 0; a < around; ++a) {
    const double phi = 2 * kPi * (a + 0.5) / around;
    cell.normal = Vector3d(std::cos(phi), std::sin(phi), 0);
    cell.half_u = Vector3d(-std::sin(phi), std::cos(phi), 0) * (kPi * r / around);
    for (int k = 0; k < up; ++k) {
      cell.center = r * cell.normal + Vector3d(0, 0, shape.height * ((k + 0.5) / up - 0.5));
      cells.push_back(cell);
    }
  }
  // Caps: rings of equal width, each sector with its own area.
  const int rings = divisions(r, max_edge, min_divisions);
  for (const double side : {1.0, -1.0}) {
    for (int k = 0; k < rings; ++k) {
      const double inner = r * k / rings;
      const double outer = r * (k + 1) / rings;
      const int sectors = std::max(4, around / (rings - k));
      for (int a = 0; a < sectors; ++a) {
        const double phi = 2 * kPi * (a + 0.5) / sectors;
        // Centroid of an annular sector.
        const double half_angle = kPi / sectors;
        const double centroid = 2.0 / 3.0 * std::sin(half_angle) / half_angle *
                                (outer * outer + outer * inner + inner * inner) / (outer + inner);
        const Vector3d radial(std::cos(phi), std::sin(phi), 0);
        cell.normal = Vector3d(0, 0, side);
        cell.center = centroid * radial + Vector3d(0, 0, side * shape.height / 2);
        cell.half_u = radial * ((outer - inner) / 2);
        cell.half_v = Vector3d(-radial.y(), radial.x(), 0) * (side * half_angle * centroid);
        cell.area = kPi * (outer * outer - inner * inner) / sectors;
        cells.push_back(cell);
      }
    }
  }
}

Triangle world_triangle(const TriangleMesh& mesh, const std::array<int, 3>& corners,
                        const Transform& T_world_shape, double size) {
  Triangle triangle;
  for (std::size_t k = 0; k < 3; ++k) {
    triangle[k] =
        T_world_shape * Vector3d(size * mesh.vertices[static_cast<std::size_t>(corners[k])]);
  }
  return triangle;
}

/// Triangle a, b, c as a cell: half edges of the parallelogram with the same second moments,
/// (s s' / 24 + d d' / 8) with s the sum and d the difference of two edges.
SurfaceCell triangle_cell(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d e = b - a;
  const Vector3d f = c - a;
  SurfaceCell cell;
  cell.center = (a + b + c) / 3;
  cell.area = 0.5 * e.cross(f).norm();
  cell.normal = e.cross(f).normalized();
  cell.half_u = (e + f) / std::sqrt(24.0);
  cell.half_v = (f - e) / std::sqrt(8.0);
  return cell;
}

/// Visits the corners of the parts of a triangle, n^2 equal ones like itself, as many as keep its
/// longest edge's parts within `most`.
template <typename Visit>
void visit_parts(const Triangle& t, double most, const Visit& visit) {
  const double longest =
      std::max({(t[1] - t[0]).norm(), (t[2] - t[1]).norm(), (t[0] - t[2]).norm()});
  const int n = divisions(longest, most, 1);
  const Vector3d e = (t[1] - t[0]) / n;
  const Vector3d f = (t[2] - t[0]) / n;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; i + j < n; ++j) {
      const Vector3d a = t[0] + i * e + j * f;
      visit(a, a + e, a + f);
      if (i + j + 1 < n) visit(a + e, a + e + f, a + f);
    }
  }
}

void divide_mesh(const MeshShape& shape, double max_edge, int min_divisions,
                 std::vector<SurfaceCell>& cells) {
  const TriangleMesh& mesh = *shape.mesh;
  // An edge counts against the whole body's size: small triangles need not be divided.
  const double most = std::min(max_edge, 2 * mesh.radius / min_divisions);
  for (const auto& corners : mesh.triangles) {
    const Triangle t = world_triangle(mesh, corners, Transform::Identity(), 1.0);
    visit_parts(t, most, [&](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
      cells.push_back(triangle_cell(a, b, c));
      if (!shape.two_sided) return;
      cells.push_back(cells.back());
      cells.back().normal = -cells.back().normal;
    });
  }
}

void add_quad(const std::array<Vector3d, 4>& quad, std::vector<Triangle>& triangles) {
  triangles.push_back({quad[0], quad[1], quad[2]});
  triangles.push_back({quad[0], quad[2], quad[3]});
}

std::vector<Triangle> triangulate_round(const Shape& shape, int segments) {
  std::vector<Triangle> triangles;
  const auto ring = [&](double radius, double z, int a) {
    const double phi = 2 * kPi * a / segments;
    return Vector3d(radius * std::cos(phi), radius * std::sin(phi), z);
  };
  if (const auto* sphere = std::get_if<SphereShape>(&shape)) {
    const int bands = std::max(4, segments / 2);
    for (int b = 0; b < bands; ++b) {
      const double t0 = kPi * b / bands - kPi / 2;
      const double t1 = kPi * (b + 1) / bands - kPi / 2;
      const double r = sphere->radius;
      for (int a = 0; a < segments; ++a) {
        add_quad({ring(r * std::cos(t0), r * std::sin(t0), a),
                  ring(r * std::cos(t0), r * std::sin(t0), a + 1),
                  ring(r * std::cos(t1), r * std::sin(t1), a + 1),
                  ring(r * std::cos(t1), r * std::sin(t1), a)},
                 triangles);
      }
    }
  } else if (const auto* cylinder = std::get_if<CylinderShape>(&shape)) {
    const double h = cylinder->height / 2;
    const double r = cylinder->radius;
    for (int a = 0; a < segments; ++a) {
      add_quad({ring(r, -h, a), ring(r, -h, a + 1), ring(r, h, a + 1), ring(r, h, a)}, triangles);
      triangles.push_back({Vector3d(0, 0, h), ring(r, h, a), ring(r, h, a + 1)});
      triangles.push_back({Vector3d(0, 0, -h), ring(r, -h, a + 1), ring(r, -h, a)});
    }
  }
  return triangles;
}

}  // namespace

std::string shape_name(const Shape& shape) {
  return std::visit(
      overloaded{[](const RectangleShape&) { return "rectangle"; },
                 [](const BoxShape&) { return "box"; }, [](const SphereShape&) { return "sphere"; },
                 [](const CylinderShape&) { return "cylinder"; },
                 [](const MeshShape&) { return "mesh"; }},
      shape);
}

Anchor default_anchor(const Shape& shape) {
  const bool stands =
      std::holds_alternative<BoxShape>(shape) || std::holds_alternative<CylinderShape>(shape);
  return stands ? Anchor::base : Anchor::center;
}

bool is_convex(const Shape& shape) {
  const auto* mesh = std::get_if<MeshShape>(&shape);
  return mesh == nullptr || mesh->mesh->convex;
}

double yaw_period(const Shape& shape) {
  if (std::holds_alternative<RectangleShape>(shape) || std::holds_alternative<MeshShape>(shape)) {
    return 2 * kPi;
  }
  if (const auto* box = std::get_if<BoxShape>(&shape)) {
    return std::abs(box->size.x() - box->size.y()) < 1e-12 ? kPi / 2 : kPi;
  }
  return 0.0;
}

namespace {

/// Distance of the footprint below the centre, m.
double depth_below_center(const Shape& shape) {
  return std::visit(overloaded{[](const RectangleShape& s) { return s.height / 2; },
                               [](const BoxShape& s) { return s.size.z() / 2; },
                               [](const SphereShape& s) { return s.radius; },
                               [](const CylinderShape& s) { return s.height / 2; },
                               [](const MeshShape& s) { return -s.mesh->lowest.z(); }},
                    shape);
}

}  // namespace

double bounding_radius(const Shape& shape, Anchor anchor) {
  const double half_height = depth_below_center(shape);
  const double vertical = anchor == Anchor::base ? 2 * half_height : half_height;
  return std::visit(
      overloaded{
          [&](const RectangleShape& s) { return std::hypot(s.width / 2, vertical); },
          [&](const BoxShape& s) { return std::hypot(s.size.x() / 2, s.size.y() / 2, vertical); },
          [&](const SphereShape& s) { return anchor == Anchor::base ? vertical : s.radius; },
          [&](const CylinderShape& s) { return std::hypot(s.radius, vertical); },
          [&](const MeshShape& s) {
            return s.mesh->radius + (anchor == Anchor::base ? half_height : 0.0);
          }},
      shape);
}

Transform object_to_world(const Shape& shape, Anchor anchor, const Placement& placement) {
  Transform T = Transform::Identity();
  T.translation() = placement.position;
  if (anchor == Anchor::base) T.translation().z() += placement.size * depth_below_center(shape);
  T.linear() = Eigen::AngleAxisd(placement.yaw, Vector3d::UnitZ()).toRotationMatrix();
  return T;
}

std::vector<SurfaceCell> divide(const Shape& shape, const Transform& T_world_shape, double size,
                                double max_edge, int min_divisions) {
  std::vector<SurfaceCell> cells;
  std::visit(
      overloaded{
          [&](const RectangleShape& s) {
            divide_flat(Vector3d::Zero(), Vector3d(0, s.width / 2, 0), Vector3d(0, 0, s.height / 2),
                        max_edge, min_divisions, cells);
          },
          [&](const BoxShape& s) {
            for (const auto& [center, u, v] : box_faces(s.size)) {
              divide_flat(center, u, v, max_edge, min_divisions, cells);
            }
          },
          [&](const SphereShape& s) { divide_sphere(s.radius, max_edge, min_divisions, cells); },
          [&](const CylinderShape& s) { divide_cylinder(s, max_edge, min_divisions, cells); },
          [&](const MeshShape& s) { divide_mesh(s, max_edge, min_divisions, cells); }},
      shape);
  const Eigen::Matrix3d rotation = T_world_shape.linear();
  for (SurfaceCell& cell : cells) {
    cell.center = T_world_shape * Vector3d(size * cell.center);
    cell.normal = rotation * cell.normal;
    cell.half_u = size * (rotation * cell.half_u);
    cell.half_v = size * (rotation * cell.half_v);
    cell.area *= size * size;
  }
  return cells;
}

namespace {

const std::vector<QuadraturePoint>& rule_along(double length, double spacing) {
  return gauss_legendre(divisions(length, spacing, 1));
}

/// Points of the parallelogram center +- half_u +- half_v; normal = u x v.
void add_flat_points(const Vector3d& center, const Vector3d& half_u, const Vector3d& half_v,
                     double spacing, std::vector<SurfacePoint>& points) {
  const Vector3d cross = half_u.cross(half_v);
  for (const QuadraturePoint& v : rule_along(2 * half_v.norm(), spacing)) {
    for (const QuadraturePoint& u : rule_along(2 * half_u.norm(), spacing)) {
      points.push_back({center + u.position * half_u + v.position * half_v, cross.normalized(),
                        u.weight * v.weight * cross.norm()});
    }
  }
}

int steps_around(double radius, double spacing) { return divisions(2 * kPi * radius, spacing, 8); }

/// Equal heights of a sphere have equal areas.
void add_sphere_points(double radius, double spacing, std::vector<SurfacePoint>& points) {
  const int around = steps_around(radius, spacing);
  for (const QuadraturePoint& z : gauss_legendre(divisions(kPi * radius, spacing, 4))) {
    const double s = std::sqrt(1 - z.position * z.position);
    for (int a = 0; a < around; ++a) {
      const double phi = 2 * kPi * (a + 0.5) / around;
      const Vector3d normal(s * std::cos(phi), s * std::sin(phi), z.position);
      points.push_back({radius * normal, normal, z.weight * 2 * kPi * radius * radius / around});
    }
  }
}

void add_cylinder_points(const CylinderShape& shape, double spacing,
                         std::vector<SurfacePoint>& points) {
  const double r = shape.radius;
  const double half = shape.height / 2;
  const int around = steps_around(r, spacing);
  for (int a = 0; a < around; ++a) {
    const double phi = 2 * kPi * (a + 0.5) / around;
    const Vector3d normal(std::cos(phi), std::sin(phi), 0);
    for (const QuadraturePoint& z : rule_along(shape.height, spacing)) {
      points.push_back({r * normal + Vector3d(0, 0, half * z.position), normal,
                        2 * kPi * r / around * half * z.weight});
    }
  }
  // Caps: equal squares of the radius have equal areas.
  for (const double side : {1.0, -1.0}) {
    for (const QuadraturePoint& square : rule_along(r, spacing)) {
      const double radius = r * std::sqrt(0.5 * (1 + square.position));
      const int sectors = steps_around(radius, spacing);
      for (int a = 0; a < sectors; ++a) {
        const double phi = 2 * kPi * (a + 0.5) / sectors;
        points.push_back({Vector3d(radius * std::cos(phi), radius * std::sin(phi), side * half),
                          Vector3d(0, 0, side), kPi * r * r * 0.5 * square.weight / sectors});
      }
    }
  }
}

/// Middles of the lines from a triangle's centre to its corners: exact for degree 2.
void add_mesh_points(const MeshShape& shape, double spacing, std::vector<SurfacePoint>& points) {
  for (const auto& corners : shape.mesh->triangles) {
    const Triangle t = world_triangle(*shape.mesh, corners, Transform::Identity(), 1.0);
    // Three points to a part of this edge.
    const double edge = std::sqrt(3.0) * spacing;
    visit_parts(t, edge, [&](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
      const Vector3d cross = (b - a).cross(c - a);
      for (const Vector3d& p : {a, b, c}) {
        const Vector3d point = 0.5 * p + (a + b + c) / 6;
        points.push_back({point, cross.normalized(), cross.norm() / 6});
        if (shape.two_sided) points.push_back({point, -cross.normalized(), cross.norm() / 6});
      }
    });
  }
}

}  // namespace

std::vector<SurfacePoint> quadrature(const Shape& shape, double spacing) {
  std::vector<SurfacePoint> points;
  std::visit(overloaded{[&](const RectangleShape& s) {
                          add_flat_points(Vector3d::Zero(), Vector3d(0, s.width / 2, 0),
                                          Vector3d(0, 0, s.height / 2), spacing, points);
                        },
                        [&](const BoxShape& s) {
                          for (const auto& [center, u, v] : box_faces(s.size)) {
                            add_flat_points(center, u, v, spacing, points);
                          }
                        },
                        [&](const SphereShape& s) { add_sphere_points(s.radius, spacing, points); },
                        [&](const CylinderShape& s) { add_cylinder_points(s, spacing, points); },
                        [&](const MeshShape& s) { add_mesh_points(s, spacing, points); }},
             shape);
  return points;
}

std::vector<std::array<Vector3d, 4>> flat_faces(const Shape& shape, const Transform& T_world_shape,
                                                double size) {
  std::vector<std::array<Vector3d, 4>> quads;
  const auto add = [&](const Vector3d& center, const Vector3d& u, const Vector3d& v) {
    const auto world = [&](double su, double sv) {
      return Vector3d(T_world_shape * Vector3d(size * (center + su * u + sv * v)));
    };
    quads.push_back({world(-1, -1), world(1, -1), world(1, 1), world(-1, 1)});
  };
  if (const auto* rectangle = std::get_if<RectangleShape>(&shape)) {
    add(Vector3d::Zero(), Vector3d(0, rectangle->width / 2, 0),
        Vector3d(0, 0, rectangle->height / 2));
  } else if (const auto* box = std::get_if<BoxShape>(&shape)) {
    for (const auto& [center, u, v] : box_faces(box->size)) add(center, u, v);
  } else if (const auto* mesh = std::get_if<MeshShape>(&shape)) {
    for (const auto& corners : mesh->mesh->triangles) {
      const Triangle t = world_triangle(*mesh->mesh, corners, T_world_shape, size);
      quads.push_back({t[0], t[1], 0.5 * (t[1] + t[2]), t[2]});
    }
  } else {
    throw Error("shape", "found " + shape_name(shape) + ", accepted: rectangle, box or mesh");
  }
  return quads;
}

std::vector<Triangle> triangulate(const Shape& shape, const Transform& T_world_shape, double size,
                                  int segments) {
  const bool flat =
      std::holds_alternative<RectangleShape>(shape) || std::holds_alternative<BoxShape>(shape);
  std::vector<Triangle> triangles;
  if (flat) {
    for (const auto& quad : flat_faces(shape, T_world_shape, size)) add_quad(quad, triangles);
    return triangles;
  }
  if (const auto* mesh = std::get_if<MeshShape>(&shape)) {
    for (const auto& corners : mesh->mesh->triangles) {
      triangles.push_back(world_triangle(*mesh->mesh, corners, T_world_shape, size));
    }
    return triangles;
  }
  triangles = triangulate_round(shape, segments);
  for (Triangle& triangle : triangles) {
    for (Vector3d& point : triangle) point = T_world_shape * Vector3d(size * point);
  }
  return triangles;
}

Vector3d face_normal(const std::array<Vector3d, 4>& corners) {
  return (corners[1] - corners[0]).cross(corners[3] - corners[0]).normalized();
}

}  // namespace blindcorner
