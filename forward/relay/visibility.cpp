// SPDX-License-Identifier: Apache-2.0
#include "forward/relay/visibility.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "forward/support/multiversion.h"

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

  Polygon() = default;
  Polygon(const Polygon& other) { *this = other; }
  /// Copies the corners that are there.
  Polygon& operator=(const Polygon& other) {
    size = other.size;
    std::copy_n(other.a.begin(), size, a.begin());
    std::copy_n(other.b.begin(), size, b.begin());
    return *this;
  }

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
    const bool closed = is_closed(surface.shape);
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

void ShadowView::leave_out_clear_of(const Vector3d& center, double radius) {
  std::erase_if(pyramids_, [&](const auto& pyramid) {
    return std::ranges::any_of(pyramid, [&](const HalfSpace& side) {
      return side.normal.dot(center) + side.offset <= -radius;
    });
  });
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

namespace {

constexpr int kChunk = ShadowView::kChunk;

/// Of a patch's corners, the least and the largest distance inside of a half space, each the least
/// over the half spaces of a pyramid; keeps the largest of all pyramids.
struct Depths {
  std::array<double, kChunk> nearest, farthest;
};

/// `planes`: normal and offset of five half spaces.
BLINDCORNER_MULTIVERSION void add_depths(const PatchCoordinates& p, int begin,
                                         const std::array<std::array<double, 4>, 5>& planes,
                                         Depths& depths) {
  double nearest[kChunk], farthest[kChunk];
  for (int i = 0; i < kChunk; ++i) nearest[i] = farthest[i] = 1e300;
  const double *x = p.center[0] + begin, *y = p.center[1] + begin, *z = p.center[2] + begin;
  const double *ux = p.half_u[0] + begin, *uy = p.half_u[1] + begin, *uz = p.half_u[2] + begin;
  const double *vx = p.half_v[0] + begin, *vy = p.half_v[1] + begin, *vz = p.half_v[2] + begin;
  for (const auto& plane : planes) {
    const double a = plane[0], b = plane[1], c = plane[2], d = plane[3];
    BLINDCORNER_INDEPENDENT
    for (int i = 0; i < kChunk; ++i) {
      const double depth = a * x[i] + b * y[i] + c * z[i] + d;
      const double reach =
          std::abs(a * ux[i] + b * uy[i] + c * uz[i]) + std::abs(a * vx[i] + b * vy[i] + c * vz[i]);
      nearest[i] = std::min(nearest[i], depth - reach);
      farthest[i] = std::min(farthest[i], depth + reach);
    }
  }
  for (int i = 0; i < kChunk; ++i) {
    const auto k = static_cast<std::size_t>(i);
    depths.nearest[k] = std::max(depths.nearest[k], nearest[i]);
    depths.farthest[k] = std::max(depths.farthest[k], farthest[i]);
  }
}

}  // namespace

void ShadowView::sights(const PatchCoordinates& patches, int begin, int end, Sight* out) const {
  for (; begin < end; begin += kChunk, out += kChunk) {
    const int count = std::min(kChunk, end - begin);
    Depths depths;
    depths.nearest.fill(-1);
    depths.farthest.fill(-1);
    for (const auto& pyramid : pyramids_) {
      std::array<std::array<double, 4>, 5> planes;
      for (std::size_t i = 0; i < 5; ++i) {
        const Vector3d& n = pyramid[i].normal;
        planes[i] = {n.x(), n.y(), n.z(), pyramid[i].offset};
      }
      add_depths(patches, begin, planes, depths);
    }
    for (int i = 0; i < count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      out[i] = depths.nearest[k] >= 0   ? Sight::hidden
               : depths.farthest[k] > 0 ? Sight::mixed
                                        : Sight::clear;
    }
  }
}

VisiblePart ShadowView::see(const Vector3d& center, const Vector3d& half_u,
                            const Vector3d& half_v) const {
  thread_local std::vector<Polygon> pieces;  // visible pieces
  thread_local std::vector<Polygon> left;
  pieces.clear();
  bool whole = true;
  for (const auto& pyramid : pyramids_) {
    std::array<Line, 5> lines;  // those that cut the patch
    std::size_t cuts = 0;
    bool clear = false;
    for (const HalfSpace& side : pyramid) {
      const Line line{side.normal.dot(center) + side.offset, side.normal.dot(half_u),
                      side.normal.dot(half_v)};
      const double reach = std::abs(line.ka) + std::abs(line.kb);
      if (line.k0 + reach <= 0) {
        clear = true;
        break;
      }
      if (line.k0 - reach < 0) lines[cuts++] = line;
    }
    if (clear) continue;
    if (cuts == 0) return {0.0, Vector3d::Zero()};
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
      for (std::size_t i = 0; i < cuts && piece.size >= 3; ++i) {
        split(piece, lines[i], inside, outside);
        if (outside.size >= 3) left.push_back(outside);
        piece = inside;
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
