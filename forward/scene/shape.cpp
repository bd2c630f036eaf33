// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/scene/shape.h"

#include "blindcorner/forward/error.h"
#include "forward/scene/shapes/shape_geometry.h"

namespace blindcorner {

using Eigen::Vector3d;

std::string shape_name(const Shape& shape) { return geometry_of(shape)->name(); }

Anchor default_anchor(const Shape& shape) { return geometry_of(shape)->default_anchor(); }

bool is_closed(const Shape& shape) { return geometry_of(shape)->closed(); }

bool is_convex(const Shape& shape) { return geometry_of(shape)->convex(); }

double yaw_period(const Shape& shape) { return geometry_of(shape)->yaw_period(); }

double bounding_radius(const Shape& shape, Anchor anchor) {
  const auto geometry = geometry_of(shape);
  return geometry->reach(anchor == Anchor::base ? geometry->depth() : 0.0);
}

Vector3d half_extents(const Shape& shape, std::optional<double> yaw) {
  return geometry_of(shape)->half_extents(yaw);
}

Transform object_to_world(const Shape& shape, Anchor anchor, const Placement& placement) {
  Transform T = Transform::Identity();
  T.translation() = placement.position;
  if (anchor == Anchor::base) {
    T.translation().z() += placement.size * geometry_of(shape)->depth();
  }
  T.linear() = Eigen::AngleAxisd(placement.yaw, Vector3d::UnitZ()).toRotationMatrix();
  return T;
}

std::vector<SurfaceCell> divide(const Shape& shape, const Transform& T_world_shape, double size,
                                double max_edge, int min_divisions) {
  std::vector<SurfaceCell> cells = geometry_of(shape)->cells(max_edge, min_divisions);
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

std::vector<SurfacePoint> quadrature(const Shape& shape, const PointSpacing& spacing) {
  return geometry_of(shape)->points(spacing);
}

std::vector<Triangle> triangulate(const Shape& shape, const Transform& T_world_shape, double size,
                                  int segments) {
  const ShapeFrame world{T_world_shape, size};
  std::vector<Triangle> triangles = geometry_of(shape)->triangles(segments);
  for (Triangle& triangle : triangles) {
    for (Vector3d& point : triangle) point = world(point);
  }
  return triangles;
}

std::vector<Quad> flat_faces(const Shape& shape, const Transform& T_world_shape, double size) {
  Silhouette silhouette = geometry_of(shape)->silhouette({T_world_shape, size});
  if (silhouette.seen_from) {
    throw Error("shape", "found " + shape_name(shape) + ", accepted: a shape of flat faces");
  }
  return std::move(silhouette.faces);
}

Vector3d face_normal(const Quad& corners) {
  return (corners[1] - corners[0]).cross(corners[3] - corners[0]).normalized();
}

}  // namespace blindcorner
