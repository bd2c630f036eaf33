// SPDX-License-Identifier: Apache-2.0
/// The interface that every shape implements.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <variant>
#include <vector>

#include "blindcorner/forward/scene/shape.h"

namespace blindcorner {

/// Takes a shape's own centred coordinates to the world.
struct ShapeFrame {
  const Transform& T_world_shape;
  double size;  ///< factor on all lengths

  Eigen::Vector3d operator()(const Eigen::Vector3d& own) const {
    return T_world_shape * Eigen::Vector3d(size * own);
  }
};

/// Most corners of a round body's outline.
inline constexpr std::size_t kMaxOutline = 8;

/// Flat faces that hide what lies behind a body, m, world.
struct Silhouette {
  std::vector<Quad> faces;  ///< of flat shapes: the same wherever they are seen from
  /// For round shapes: the corners, in order, of the flat convex outline that a point outside of
  /// the body sees. Their number is even, from four to kMaxOutline. From inside there are none.
  /// Null for flat shapes.
  std::function<std::vector<Eigen::Vector3d>(const Eigen::Vector3d& point)> seen_from;
};

/// Properties of one shape, in its own centred coordinates (m) unless a comment says otherwise.
/// Each shape implements them in one file of this folder. A shape that lacks one does not compile.
class ShapeGeometry {
 public:
  virtual ~ShapeGeometry() = default;

  virtual const char* name() const = 0;
  virtual Anchor default_anchor() const = 0;

  /// Whether it encloses a volume.
  virtual bool closed() const = 0;
  /// Whether no line between two of its points leaves it.
  virtual bool convex() const = 0;
  /// Whether its faces reflect on both sides, else on the outer one only.
  virtual bool two_sided() const = 0;
  /// Smallest turn about z after which the shape looks the same, rad; 0 if every turn does.
  virtual double yaw_period() const = 0;

  /// Distance of the lowest point below the centre.
  virtual double depth() const = 0;
  /// Largest distance of a point of the shape from the point `below` metres under its centre.
  virtual double reach(double below) const = 0;
  /// Half edges of a box that holds the shape turned by `yaw` rad. The box is centred on the shape
  /// and parallel to the world's axes. Without `yaw`, it holds the shape at any yaw.
  virtual Eigen::Vector3d half_extents(std::optional<double> yaw) const = 0;

  /// Cells and points of `divide` and `quadrature`.
  virtual std::vector<SurfaceCell> cells(double max_edge, int min_divisions) const = 0;
  virtual std::vector<SurfacePoint> points(const PointSpacing& spacing) const = 0;
  /// Whether the cells are parallelograms that fill the surface, so that each may be sampled again.
  virtual bool parallelogram_cells() const = 0;

  /// Counter-clockwise seen from outside; round shapes with `segments` steps around.
  virtual std::vector<Triangle> triangles(int segments) const = 0;
  virtual Silhouette silhouette(const ShapeFrame& world) const = 0;
};

inline std::unique_ptr<const ShapeGeometry> geometry_of(const Shape& shape) {
  return std::visit([](const auto& s) { return s.geometry(); }, shape);
}

}  // namespace blindcorner
