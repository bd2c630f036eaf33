// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/visibility.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Convex polygon in the patch's own coordinates (a, b) in [-1, 1]^2. Each line that cuts it adds
/// at most one corner: five per occluder face that meets the patch.
struct Polygon {
  static constexpr int kMax = 40;
  std::array<double, kMax> a;
  std::array<double, kMax> b;
  int size = 0;

  void add(double x, double y) {
    if (size < kMax) {
      a[static_cast<std::size_t>(size)] = x;
      b[static_cast<std::size_t>(size)] = y;
      ++size;
    }
  }
};

/// k0 + ka a + kb b, positive inside.
struct Line {
  double k0, ka, kb;
  double at(double a, double b) const { return k0 + ka * a + kb * b; }
};

/// Splits a convex polygon by a line.
void split(const Polygon& polygon, const Line& line, Polygon& inside, Polygon& outside) {
  inside.size = outside.size = 0;
  for (int i = 0; i < polygon.size; ++i) {
    const auto p = static_cast<std::size_t>(i);
    const auto q = static_cast<std::size_t>((i + 1) % polygon.size);
    const double fp = line.at(polygon.a[p], polygon.b[p]);
    const double fq = line.at(polygon.a[q], polygon.b[q]);
    (fp >= 0 ? inside : outside).add(polygon.a[p], polygon.b[p]);
    if ((fp >= 0) != (fq >= 0)) {
      const double t = fp / (fp - fq);
      const double a = polygon.a[p] + t * (polygon.a[q] - polygon.a[p]);
      const double b = polygon.b[p] + t * (polygon.b[q] - polygon.b[p]);
      inside.add(a, b);
      outside.add(a, b);
    }
  }
}

/// Adds area and first moments of a polygon.
void accumulate(const Polygon& polygon, double& area, double& moment_a, double& moment_b) {
  for (int i = 1; i + 1 < polygon.size; ++i) {
    const auto p = static_cast<std::size_t>(i);
    const double ua = polygon.a[p] - polygon.a[0];
    const double ub = polygon.b[p] - polygon.b[0];
    const double va = polygon.a[p + 1] - polygon.a[0];
    const double vb = polygon.b[p + 1] - polygon.b[0];
    const double part = 0.5 * (ua * vb - ub * va);
    area += part;
    moment_a += part * (polygon.a[0] + polygon.a[p] + polygon.a[p + 1]) / 3;
    moment_b += part * (polygon.b[0] + polygon.b[p] + polygon.b[p + 1]) / 3;
  }
}

}  // namespace

std::vector<OccluderFace> occluder_faces(const std::vector<Surface>& surfaces) {
  std::vector<OccluderFace> faces;
  for (const Surface& surface : surfaces) {
    if (!surface.occluder) continue;
    const bool closed = std::holds_alternative<BoxShape>(surface.shape);
    for (const auto& quad : flat_faces(surface.shape, surface.T_world_surface, 1.0)) {
      faces.push_back({quad, closed});
    }
  }
  return faces;
}

ShadowView::ShadowView(const std::vector<OccluderFace>& faces, const Vector3d& viewpoint) {
  pyramids_.reserve(faces.size());
  for (const OccluderFace& face : faces) {
    const auto& c = face.corners;
    const Vector3d normal = face_normal(c);
    const double side = normal.dot(viewpoint - c[0]);
    if (std::abs(side) < 1e-9 || (face.one_sided && side < 0)) continue;
    std::array<HalfSpace, 5> pyramid;
    const double sign = side > 0 ? -1 : 1;
    pyramid[0] = {sign * normal, -sign * normal.dot(c[0])};
    const Vector3d center = 0.25 * (c[0] + c[1] + c[2] + c[3]);
    for (std::size_t i = 0; i < 4; ++i) {
      Vector3d edge = (c[i] - viewpoint).cross(c[(i + 1) % 4] - viewpoint).normalized();
      if (edge.dot(center - viewpoint) < 0) edge = -edge;
      pyramid[i + 1] = {edge, -edge.dot(viewpoint)};
    }
    pyramids_.push_back(pyramid);
  }
}

ShadowView::Sight ShadowView::sight(const Vector3d& center, double radius) const {
  bool clear = true;
  for (const auto& pyramid : pyramids_) {
    double least = radius + 1;
    for (const HalfSpace& side : pyramid) {
      least = std::min(least, side.normal.dot(center) + side.offset);
      if (least <= -radius) break;
    }
    if (least >= radius) return Sight::hidden;
    if (least > -radius) clear = false;
  }
  return clear ? Sight::clear : Sight::mixed;
}

VisiblePart ShadowView::see(const Vector3d& center, const Vector3d& half_u,
                            const Vector3d& half_v) const {
  thread_local std::vector<Polygon> pieces;  // visible pieces
  thread_local std::vector<Polygon> left;
  pieces.clear();
  bool whole = true;
  for (const auto& pyramid : pyramids_) {
    std::array<Line, 5> lines;
    bool clear = false;
    bool hidden = true;
    for (std::size_t i = 0; i < 5; ++i) {
      lines[i] = {pyramid[i].normal.dot(center) + pyramid[i].offset, pyramid[i].normal.dot(half_u),
                  pyramid[i].normal.dot(half_v)};
      const double reach = std::abs(lines[i].ka) + std::abs(lines[i].kb);
      if (lines[i].k0 + reach <= 0) {
        clear = true;
        break;
      }
      if (lines[i].k0 - reach < 0) hidden = false;
    }
    if (clear) continue;
    if (hidden) return {0.0, Vector3d::Zero()};
    if (whole) {
      Polygon square;
      square.add(-1, -1);
      square.add(1, -1);
      square.add(1, 1);
      square.add(-1, 1);
      pieces.assign(1, square);
      whole = false;
    }
    left.clear();
    for (Polygon& piece : pieces) {
      Polygon inside;
      Polygon outside;
      for (const Line& line : lines) {
        split(piece, line, inside, outside);
        if (outside.size >= 3) left.push_back(outside);
        piece = inside;
        if (piece.size < 3) break;
      }
    }
    std::swap(pieces, left);
    if (pieces.empty()) return {0.0, Vector3d::Zero()};
  }
  if (whole) return {};
  double area = 0;
  double moment_a = 0;
  double moment_b = 0;
  for (const Polygon& piece : pieces) accumulate(piece, area, moment_a, moment_b);
  if (area <= 0) return {0.0, Vector3d::Zero()};
  return {area / 4, moment_a / area * half_u + moment_b / area * half_v};
}

}  // namespace blindcorner
