// SPDX-License-Identifier: Apache-2.0
/// Parts that several shapes share.
#pragma once

#include <vector>

#include "forward/scene/shapes/shape_geometry.h"
#include "forward/transport/gauss_legendre.h"

namespace blindcorner {

/// Number of equal parts of an edge (m), each at most `max_edge` long.
int divisions(double edge, double max_edge, int min_divisions);

/// Gauss-Legendre points along a length (m).
const std::vector<QuadraturePoint>& rule_along(double length, double spacing);

void add_triangles(const Quad& quad, std::vector<Triangle>& triangles);

/// A body or sheet whose sides are parallelograms.
class FlatGeometry : public ShapeGeometry {
 public:
  bool convex() const final { return true; }
  bool two_sided() const final { return false; }
  double depth() const final { return half_edges().z(); }
  Eigen::Vector3d half_extents(std::optional<double> yaw) const final;
  std::vector<SurfaceCell> cells(double max_edge, int min_divisions) const final;
  std::vector<SurfacePoint> points(const PointSpacing& spacing) const final;
  bool parallelogram_cells() const final { return true; }
  std::vector<Triangle> triangles(int segments) const final;
  Silhouette silhouette(const ShapeFrame& world) const final;

 protected:
  /// center +- half_u +- half_v, outward normal u x v.
  struct Side {
    Eigen::Vector3d center, half_u, half_v;
  };
  virtual std::vector<Side> sides() const = 0;
  /// Half edges of the bounding box along its own axes.
  virtual Eigen::Vector3d half_edges() const = 0;
};

/// A body of revolution about z.
class RoundGeometry : public ShapeGeometry {
 public:
  bool closed() const final { return true; }
  bool convex() const final { return true; }
  bool two_sided() const final { return false; }
  double yaw_period() const final { return 0.0; }
  bool parallelogram_cells() const final { return false; }

 protected:
  /// Points around a circle, at least 8.
  static int steps_around(double radius, double spacing);
  struct Circle {
    double radius, z;  ///< m
  };
  static Eigen::Vector3d point_on(const Circle& circle, int a, int segments);
  /// The quad between steps a and a + 1 of two circles, `low` below `high`.
  static void add_ring(const Circle& low, const Circle& high, int a, int segments,
                       std::vector<Triangle>& triangles);
};

}  // namespace blindcorner
