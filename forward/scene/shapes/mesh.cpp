// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "forward/scene/shapes/shape_parts.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Share of the body's size by which a vertex of a convex body may stand out of a face. It allows
/// for the rounding of files with single precision.
constexpr double kConvexTolerance = 1e-6;

void check(const TriangleMesh& mesh) {
  if (mesh.vertices.empty()) throw Error("mesh", "found no vertex, accepted: at least three");
  if (mesh.triangles.empty()) throw Error("mesh", "found no triangle, accepted: at least one");
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (mesh.vertices[i].allFinite()) continue;
    throw Error("mesh", "found a vertex that is not finite (vertex " + std::to_string(i + 1) +
                            "), accepted: finite metres");
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const int corner : mesh.triangles[t]) {
      if (corner >= 0 && corner < static_cast<int>(mesh.vertices.size())) continue;
      throw Error("mesh", "found vertex " + std::to_string(corner + 1) + " in triangle " +
                              std::to_string(t + 1) + ", accepted: 1 to " +
                              std::to_string(mesh.vertices.size()));
    }
  }
}

struct Corners {
  const Vector3d &a, &b, &c;
  Vector3d cross() const { return (b - a).cross(c - a); }
};

Corners corners_of(const TriangleMesh& mesh, const std::array<int, 3>& triangle) {
  const auto vertex = [&](std::size_t k) -> const Vector3d& {
    return mesh.vertices[static_cast<std::size_t>(triangle[k])];
  };
  return {vertex(0), vertex(1), vertex(2)};
}

bool is_closed(const TriangleMesh& mesh) {
  std::map<std::pair<int, int>, int> edges;
  for (const auto& t : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
  }
  return std::all_of(edges.begin(), edges.end(), [&](const auto& edge) {
    const auto back = edges.find({edge.first.second, edge.first.first});
    return edge.second == 1 && back != edges.end() && back->second == 1;
  });
}

/// Vertices in nested boxes. To find a vertex beyond a plane, only the boxes that reach beyond the
/// plane are searched.
class VertexTree {
 public:
  explicit VertexTree(std::vector<Vector3d> vertices) : vertices_(std::move(vertices)) {
    divide(0, vertices_.size());
  }

  bool any_beyond(const Vector3d& normal, double height, std::size_t node = 0) const {
    const Node& n = nodes_[node];
    const Vector3d farthest =
        (normal.array() > 0).select(n.box.max().array(), n.box.min().array()).matrix();
    if (!(normal.dot(farthest) > height)) return false;
    if (n.second != 0) {
      return any_beyond(normal, height, node + 1) || any_beyond(normal, height, n.second);
    }
    return std::any_of(vertices_.begin() + static_cast<std::ptrdiff_t>(n.begin),
                       vertices_.begin() + static_cast<std::ptrdiff_t>(n.end),
                       [&](const Vector3d& v) { return normal.dot(v) > height; });
  }

 private:
  static constexpr std::size_t kLeaf = 16;
  struct Node {
    Eigen::AlignedBox3d box;
    std::size_t begin = 0, end = 0;
    std::size_t second = 0;  ///< node of the second part; the first follows its parent; 0: a leaf
  };

  void divide(std::size_t begin, std::size_t end) {
    const std::size_t self = nodes_.size();
    Node node;
    node.begin = begin;
    node.end = end;
    for (std::size_t i = begin; i < end; ++i) node.box.extend(vertices_[i]);
    nodes_.push_back(node);
    if (end - begin <= kLeaf) return;
    Eigen::Index axis = 0;
    node.box.sizes().maxCoeff(&axis);
    const std::size_t middle = begin + (end - begin) / 2;
    const auto at = [&](std::size_t i) {
      return vertices_.begin() + static_cast<std::ptrdiff_t>(i);
    };
    std::nth_element(at(begin), at(middle), at(end),
                     [axis](const Vector3d& a, const Vector3d& b) { return a[axis] < b[axis]; });
    divide(begin, middle);
    nodes_[self].second = nodes_.size();
    divide(middle, end);
  }

  std::vector<Vector3d> vertices_;
  std::vector<Node> nodes_;
};

bool is_convex_body(const TriangleMesh& mesh) {
  const VertexTree tree(mesh.vertices);
  return std::none_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const auto& triangle) {
    const Corners t = corners_of(mesh, triangle);
    const Vector3d normal = t.cross().normalized();
    return tree.any_beyond(normal, normal.dot(t.a) + kConvexTolerance * mesh.radius);
  });
}

/// Triangle a, b, c as a cell. Its half edges u, v are those of the parallelogram with the same
/// second moments: u u' + v v' = s s' / 24 + d d' / 8, with s the sum and d the difference of two
/// edges.
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

/// Divides a triangle into n^2 equal parts similar to it and visits the corners of each part. n is
/// the least number that keeps the parts of the longest edge within `most`.
template <typename Visit>
void visit_parts(const Corners& t, double most, const Visit& visit) {
  const double longest = std::max({(t.b - t.a).norm(), (t.c - t.b).norm(), (t.a - t.c).norm()});
  const int n = divisions(longest, most, 1);
  const Vector3d e = (t.b - t.a) / n;
  const Vector3d f = (t.c - t.a) / n;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; i + j < n; ++j) {
      const Vector3d a = t.a + i * e + j * f;
      visit(a, a + e, a + f);
      if (i + j + 1 < n) visit(a + e, a + e + f, a + f);
    }
  }
}

class Mesh final : public ShapeGeometry {
 public:
  explicit Mesh(const MeshShape& shape) : mesh_(shape.mesh), two_sided_(shape.two_sided) {}

  const char* name() const override { return "mesh"; }
  Anchor default_anchor() const override { return Anchor::center; }
  bool closed() const override { return mesh_->closed; }
  bool convex() const override { return mesh_->convex; }
  bool two_sided() const override { return two_sided_; }
  double yaw_period() const override { return 2 * kPi; }
  double depth() const override { return -mesh_->lowest.z(); }
  double reach(double below) const override { return mesh_->radius + below; }
  Vector3d half_extents(std::optional<double> /*yaw*/) const override {
    return Vector3d::Constant(mesh_->radius);
  }

  std::vector<SurfaceCell> cells(double max_edge, int min_divisions) const override {
    // `min_divisions` refers to the whole body's size: small triangles need not be divided.
    const double most = std::min(max_edge, 2 * mesh_->radius / min_divisions);
    std::vector<SurfaceCell> cells;
    for (const auto& triangle : mesh_->triangles) {
      visit_parts(corners_of(*mesh_, triangle), most,
                  [&](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
                    cells.push_back(triangle_cell(a, b, c));
                    if (!two_sided_) return;
                    cells.push_back(cells.back());
                    cells.back().normal = -cells.back().normal;
                  });
    }
    return cells;
  }

  /// Three points in each part: the middles of the lines from its centre to its corners. They are
  /// exact for degree 2.
  std::vector<SurfacePoint> points(const PointSpacing& spacing) const override {
    const double edge = std::sqrt(3.0) * spacing.least();  // three points to a part of this edge
    std::vector<SurfacePoint> points;
    for (const auto& triangle : mesh_->triangles) {
      visit_parts(corners_of(*mesh_, triangle), edge,
                  [&](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
                    const Vector3d cross = (b - a).cross(c - a);
                    const Vector3d normal = cross.normalized();
                    for (const Vector3d& p : {a, b, c}) {
                      const Vector3d point = 0.5 * p + (a + b + c) / 6;
                      points.push_back({point, normal, cross.norm() / 6});
                      if (two_sided_) points.push_back({point, -normal, cross.norm() / 6});
                    }
                  });
    }
    return points;
  }

  bool parallelogram_cells() const override { return false; }

  std::vector<Triangle> triangles(int /*segments*/) const override {
    std::vector<Triangle> triangles;
    for (const auto& triangle : mesh_->triangles) {
      const Corners t = corners_of(*mesh_, triangle);
      triangles.push_back({t.a, t.b, t.c});
    }
    return triangles;
  }

  Silhouette silhouette(const ShapeFrame& world) const override {
    Silhouette silhouette;
    for (const auto& triangle : mesh_->triangles) {
      const Corners t = corners_of(*mesh_, triangle);
      const Vector3d b = world(t.b);
      const Vector3d c = world(t.c);
      silhouette.faces.push_back({world(t.a), b, 0.5 * (b + c), c});
    }
    return silhouette;
  }

 private:
  std::shared_ptr<const TriangleMesh> mesh_;
  bool two_sided_;
};

}  // namespace

std::unique_ptr<const ShapeGeometry> MeshShape::geometry() const {
  return std::make_unique<Mesh>(*this);
}

std::shared_ptr<const TriangleMesh> make_mesh(std::vector<Vector3d> vertices,
                                              std::vector<std::array<int, 3>> triangles) {
  auto mesh = std::make_shared<TriangleMesh>();
  mesh->vertices = std::move(vertices);
  mesh->triangles = std::move(triangles);
  check(*mesh);
  Vector3d first = Vector3d::Zero();
  double area = 0;
  for (const auto& triangle : mesh->triangles) {
    const Corners t = corners_of(*mesh, triangle);
    const double part = 0.5 * t.cross().norm();
    first += part * (t.a + t.b + t.c) / 3;
    area += part;
  }
  if (!(area > 0)) throw Error("mesh", "found triangles without area, accepted: an area above 0");
  std::erase_if(mesh->triangles, [&](const auto& triangle) {
    return !(corners_of(*mesh, triangle).cross().norm() > 0);  // lines and points reflect nothing
  });
  mesh->origin = -first / area;
  Vector3d low = Vector3d::Constant(1e300);
  Vector3d high = -low;
  for (Vector3d& vertex : mesh->vertices) vertex += mesh->origin;
  for (const auto& triangle : mesh->triangles) {
    for (const int corner : triangle) {
      const Vector3d& vertex = mesh->vertices[static_cast<std::size_t>(corner)];
      low = low.cwiseMin(vertex);
      high = high.cwiseMax(vertex);
      mesh->radius = std::max(mesh->radius, vertex.norm());
    }
  }
  mesh->lowest = low;
  mesh->extent = high - low;
  mesh->closed = is_closed(*mesh);
  mesh->convex = mesh->closed && is_convex_body(*mesh);
  return mesh;
}

}  // namespace blindcorner
