// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>
#include <utility>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/shape.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Share of the body's size by which a vertex of a convex body may stand out of a face: rounding of
/// files with single precision.
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

bool is_convex_body(const TriangleMesh& mesh) {
  return std::all_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const auto& triangle) {
    const Corners t = corners_of(mesh, triangle);
    const Vector3d normal = t.cross().normalized();
    return std::all_of(mesh.vertices.begin(), mesh.vertices.end(), [&](const Vector3d& v) {
      return normal.dot(v - t.a) <= kConvexTolerance * mesh.radius;
    });
  });
}

}  // namespace

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
