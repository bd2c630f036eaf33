// SPDX-License-Identifier: Apache-2.0
/// Shapes of surfaces and hidden objects, and their division into small flat cells.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "blindcorner/forward/scene/pose.h"

namespace blindcorner {

/// Implements the functions below for one shape. Each shape has its own file in
/// forward/scene/shapes. Internal to the library.
class ShapeGeometry;

// A shape's `lengths` calls `visit(name, value)` for each of its lengths in m, a double or a
// vector, with its name in scene files. Reading and validation go through it.

/// Flat rectangle in its own y-z plane with normal +x. Only the side of the normal reflects.
struct RectangleShape {
  double width = 1.0;   ///< m, along its own y
  double height = 1.0;  ///< m, along its own z
  static void lengths(auto& shape, auto visit) {
    visit("width_m", shape.width);
    visit("height_m", shape.height);
  }
  std::unique_ptr<const ShapeGeometry> geometry() const;
};
/// Box with edges along its own axes.
struct BoxShape {
  Eigen::Vector3d size = Eigen::Vector3d::Ones();  ///< m
  static void lengths(auto& shape, auto visit) { visit("size_m", shape.size); }
  std::unique_ptr<const ShapeGeometry> geometry() const;
};
struct SphereShape {
  double radius = 0.5;  ///< m
  static void lengths(auto& shape, auto visit) { visit("radius_m", shape.radius); }
  std::unique_ptr<const ShapeGeometry> geometry() const;
};
/// Vertical cylinder, closed at top and bottom.
struct CylinderShape {
  double radius = 0.5;  ///< m
  double height = 1.0;  ///< m, along z
  static void lengths(auto& shape, auto visit) {
    visit("radius_m", shape.radius);
    visit("height_m", shape.height);
  }
  std::unique_ptr<const ShapeGeometry> geometry() const;
};

/// Triangles in coordinates about the centroid of their area, m. Made by `make_mesh`.
struct TriangleMesh {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::array<int, 3>> triangles;         ///< counter-clockwise seen from outside
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< origin of the given vertices' coordinates
  Eigen::Vector3d extent = Eigen::Vector3d::Zero();  ///< m, bounding box along the mesh's own axes
  Eigen::Vector3d lowest = Eigen::Vector3d::Zero();  ///< lowest corner of the bounding box
  double radius = 0.0;  ///< m, distance of the farthest vertex from the centroid
  bool closed = false;  ///< every edge joins two triangles that run along it in opposite directions
  bool convex = false;  ///< closed, and no vertex lies outside of any face
};

/// Moves the vertices to the centroid and computes the other fields. Throws Error when no triangle
/// has an area, a vertex is not finite or an index is out of range.
std::shared_ptr<const TriangleMesh> make_mesh(std::vector<Eigen::Vector3d> vertices,
                                              std::vector<std::array<int, 3>> triangles);

/// Body or sheet made of triangles.
struct MeshShape {
  std::shared_ptr<const TriangleMesh> mesh;
  bool two_sided = false;  ///< true: both sides reflect, else only the outer one; both block
  std::unique_ptr<const ShapeGeometry> geometry() const;
};

using Shape = std::variant<RectangleShape, BoxShape, SphereShape, CylinderShape, MeshShape>;

/// "rectangle", "box", "sphere", "cylinder" or "mesh".
std::string shape_name(const Shape& shape);

/// Point of the shape that a position refers to: the centre, or the centre of the footprint.
enum class Anchor { center, base };

/// `base` for shapes that stand (box, cylinder), `center` otherwise.
Anchor default_anchor(const Shape& shape);

/// Whether the shape encloses a volume. Its faces then count only when seen from outside.
bool is_closed(const Shape& shape);

/// Whether every line between two points of the shape stays inside the shape. Such a shape cannot
/// shadow itself.
bool is_convex(const Shape& shape);

/// Period in radians of the yaw angles at which the shape looks the same: 2 pi for a rectangle, pi
/// for a box, pi/2 for a box of square footprint, 2 pi for a mesh, 0 for shapes that yaw does not
/// change.
double yaw_period(const Shape& shape);

/// Largest distance of a point of the shape from its anchor, m. An upper bound for a mesh with the
/// anchor `base`.
double bounding_radius(const Shape& shape, Anchor anchor);

/// Half edges (m) of a box that holds the shape turned by `yaw` rad. The box is centred on the
/// shape and parallel to the world's axes. Without `yaw`, the box holds the shape at any yaw.
Eigen::Vector3d half_extents(const Shape& shape, std::optional<double> yaw);

/// Small flat piece of a surface, in world coordinates (m). On a curved shape the cell lies in the
/// tangent plane, and its area is that of the curved piece.
struct SurfaceCell {
  Eigen::Vector3d center;
  Eigen::Vector3d normal;  ///< unit, outward
  Eigen::Vector3d half_u;  ///< half edge
  Eigen::Vector3d half_v;  ///< half edge
  double area = 0.0;       ///< m^2
};

/// Transforms the shape's own centred coordinates to the world, for a placement of its anchor. The
/// factor `placement.size` on lengths is applied separately.
Transform object_to_world(const Shape& shape, Anchor anchor, const Placement& placement);

/// Divides the placed shape into flat cells. Cell edges are at most `max_edge` metres (before the
/// factor `size`), and each edge of the shape has at least `min_divisions` cells. The number and
/// the order of cells depend only on the shape and these two numbers, never on the placement. Sums
/// over cells are therefore smooth in the placement. Cells of a curved shape carry the area of the
/// curved piece.
std::vector<SurfaceCell> divide(const Shape& shape, const Transform& T_world_shape, double size,
                                double max_edge, int min_divisions = 1);

/// Point of a surface (m) and the area that the point represents (m^2).
struct SurfacePoint {
  Eigen::Vector3d center;
  Eigen::Vector3d normal;  ///< unit, outward
  double area = 0.0;
};

/// Largest distances between quadrature points, m: in horizontal directions and upwards.
struct PointSpacing {
  double across;
  double up;

  PointSpacing(double everywhere)
      : across(everywhere), up(everywhere) {}  // NOLINT(google-explicit-constructor)
  PointSpacing(double horizontal, double vertical) : across(horizontal), up(vertical) {}
  double least() const { return across < up ? across : up; }
};

/// Quadrature points of the shape in its own coordinates, at most about `spacing` apart (spheres
/// and meshes use the smaller of the two spacings everywhere). Flat faces, heights and radii have
/// Gauss-Legendre rules, circles have even steps, and each part of a triangle has three points
/// (degree 2). For smooth functions of the surface, the integration error falls exponentially in
/// 1/spacing (mesh: with the third power of the spacing).
std::vector<SurfacePoint> quadrature(const Shape& shape, const PointSpacing& spacing);

using Triangle = std::array<Eigen::Vector3d, 3>;

/// Triangles of the placed shape for ray tracing, counter-clockwise seen from outside. Curved
/// shapes are tessellated with `segments` steps around.
std::vector<Triangle> triangulate(const Shape& shape, const Transform& T_world_shape, double size,
                                  int segments = 48);

/// Corners of a planar face, counter-clockwise seen from outside.
using Quad = std::array<Eigen::Vector3d, 4>;

/// Flat faces of a rectangle (1), a box (6) or a mesh (one face for each triangle; the third corner
/// of the face is the middle of an edge). Throws Error for curved shapes.
std::vector<Quad> flat_faces(const Shape& shape, const Transform& T_world_shape, double size);

/// Unit normal of a face. It points to the side from which the corners run counter-clockwise.
Eigen::Vector3d face_normal(const Quad& corners);

}  // namespace blindcorner
