// SPDX-License-Identifier: Apache-2.0
#include "forward/relay/visibility.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "forward/support/multiversion.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Convex polygon in the patch's own coordinates (a, b) in [-1, 1]^2. Each line that cuts it adds
/// at most one corner. A face cuts with one line more than it has corners.
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

/// Splits a convex polygon by a line; `outside` may be null.
void split(const Polygon& polygon, const Line& line, Polygon& inside, Polygon* outside) {
  inside.size = 0;
  if (outside != nullptr) outside->size = 0;
  if (polygon.size == 0) return;
  const auto last = static_cast<std::size_t>(polygon.size) - 1;
  double fp = line.at(polygon.a[0], polygon.b[0]);
  const double first = fp;
  for (std::size_t p = 0; p <= last; ++p) {
    const std::size_t q = p < last ? p + 1 : 0;
    const double fq = p < last ? line.at(polygon.a[q], polygon.b[q]) : first;
    if (fp >= 0) {
      inside.add(polygon.a[p], polygon.b[p]);
    } else if (outside != nullptr) {
      outside->add(polygon.a[p], polygon.b[p]);
    }
    if ((fp >= 0) != (fq >= 0)) {
      const double t = fp / (fp - fq);
      const double a = polygon.a[p] + t * (polygon.a[q] - polygon.a[p]);
      const double b = polygon.b[p] + t * (polygon.b[q] - polygon.b[p]);
      inside.add(a, b);
      if (outside != nullptr) outside->add(a, b);
    }
    fp = fq;
  }
}

/// Area and first moments about the patch's centre. Those of the whole patch are 4, 0 and 0.
struct Area {
  double size = 0, moment_a = 0, moment_b = 0;
};

/// Adds the area and the moments of a polygon.
void accumulate(const Polygon& polygon, Area& area) {
  for (int i = 1; i + 1 < polygon.size; ++i) {
    const auto p = static_cast<std::size_t>(i);
    const double ua = polygon.a[p] - polygon.a[0];
    const double ub = polygon.b[p] - polygon.b[0];
    const double va = polygon.a[p + 1] - polygon.a[0];
    const double vb = polygon.b[p + 1] - polygon.b[0];
    const double part = 0.5 * (ua * vb - ub * va);
    area.size += part;
    area.moment_a += part * (polygon.a[0] + polygon.a[p] + polygon.a[p + 1]) / 3;
    area.moment_b += part * (polygon.b[0] + polygon.b[p] + polygon.b[p + 1]) / 3;
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
  for (const OccluderFace& face : faces) add(face.corners, face.one_sided, viewpoint);
}

void ShadowView::add(std::span<const Vector3d> c, bool one_sided, const Vector3d& viewpoint) {
  if (c.empty()) return;
  const Vector3d normal = (c[1] - c[0]).cross(c.back() - c[0]).normalized();
  const double side = normal.dot(viewpoint - c[0]);
  if (std::abs(side) < 1e-9 || (one_sided && side < 0)) return;
  Pyramid& pyramid = pyramids_.emplace_back();
  const double sign = side > 0 ? -1 : 1;
  pyramid.sides[pyramid.count++] = {sign * normal, -sign * normal.dot(c[0])};
  const Vector3d center = std::accumulate(c.begin(), c.end(), Vector3d(Vector3d::Zero())) /
                          static_cast<double>(c.size());
  for (std::size_t i = 0; i < c.size(); ++i) {
    Vector3d edge = (c[i] - viewpoint).cross(c[(i + 1) % c.size()] - viewpoint).normalized();
    if (edge.dot(center - viewpoint) < 0) edge = -edge;
    pyramid.sides[pyramid.count++] = {edge, -edge.dot(viewpoint)};
  }
}

namespace {

/// Whether a face hides nothing of a body around `center`: the whole body lies outside of one of
/// the pyramid's half spaces. `reach` gives the body's extent from `center` along a normal.
template <class Pyramid, class Reach>
bool clear_of(const Pyramid& pyramid, const Vector3d& center, const Reach& reach) {
  return std::ranges::any_of(pyramid, [&](const auto& side) {
    return side.normal.dot(center) + side.offset <= -reach(side.normal);
  });
}

}  // namespace

void ShadowView::leave_out_clear_of(const Vector3d& center, double radius) {
  std::erase_if(pyramids_, [&](const auto& pyramid) {
    return clear_of(pyramid, center, [radius](const Vector3d&) { return radius; });
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

/// The box around a chunk of patches, its edges along the axes.
struct Box {
  Vector3d center, half;
};

/// Lower and upper end along one axis of the first `count` patches of a chunk. The entries that
/// follow them are padding.
BLINDCORNER_MULTIVERSION void find_ends(const double* center, const double* half_u,
                                        const double* half_v, int count, double& low,
                                        double& high) {
  double least[kChunk], most[kChunk];
  for (int i = 0; i < kChunk; ++i) {
    const double reach = std::abs(half_u[i]) + std::abs(half_v[i]);
    least[i] = center[i] - reach;
    most[i] = center[i] + reach;
  }
  for (int i = count; i < kChunk; ++i) {
    least[i] = least[0];
    most[i] = most[0];
  }
  for (int step = kChunk / 2; step > 0; step /= 2) {
    for (int i = 0; i < step; ++i) {
      least[i] = std::min(least[i], least[i + step]);
      most[i] = std::max(most[i], most[i + step]);
    }
  }
  low = least[0];
  high = most[0];
}

Box box_around(const PatchCoordinates& p, int begin, int count) {
  Vector3d low, high;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto axis = static_cast<Eigen::Index>(k);
    find_ends(p.center[k] + begin, p.half_u[k] + begin, p.half_v[k] + begin, count, low[axis],
              high[axis]);
  }
  return {0.5 * (low + high), 0.5 * (high - low)};
}

/// The least (`nearest`) and the largest (`farthest`) depth of a patch's corners inside a half
/// space. Each is the minimum over the half spaces of a pyramid, then the maximum over all
/// pyramids.
struct Depths {
  std::array<double, kChunk> nearest, farthest;
};

/// Adds a pyramid. `planes` holds normal and offset of its half spaces.
BLINDCORNER_MULTIVERSION void add_depths(const PatchCoordinates& p, int begin,
                                         std::span<const std::array<double, 4>> planes,
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
    const Box box = box_around(patches, begin, count);
    Depths depths;
    depths.nearest.fill(-1);
    depths.farthest.fill(-1);
    for (const auto& pyramid : pyramids_) {
      const auto reach = [&](const Vector3d& normal) { return normal.cwiseAbs().dot(box.half); };
      if (clear_of(pyramid, box.center, reach)) continue;
      std::array<std::array<double, 4>, kMaxOutline + 1> planes;
      for (std::size_t i = 0; i < pyramid.count; ++i) {
        const Vector3d& n = pyramid.sides[i].normal;
        planes[i] = {n.x(), n.y(), n.z(), pyramid.sides[i].offset};
      }
      add_depths(patches, begin, {planes.data(), pyramid.count}, depths);
    }
    for (int i = 0; i < count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      out[i] = depths.nearest[k] >= 0   ? Sight::hidden
               : depths.farthest[k] > 0 ? Sight::mixed
                                        : Sight::clear;
    }
  }
}

namespace {

Polygon whole_patch() {
  Polygon square;
  square.add(-1, -1);
  square.add(1, -1);
  square.add(1, 1);
  square.add(-1, 1);
  return square;
}

/// The half spaces of a pyramid that cut a patch.
struct Cuts {
  std::array<Line, kMaxOutline + 1> lines;
  std::size_t count = 0;

  std::span<const Line> all() const { return {lines.data(), count}; }
};

/// Visible area of a patch behind one face: the square without the part inside the pyramid.
Area behind_one(const Cuts& cuts) {
  std::array<Polygon, 2> polygons;
  polygons[0] = whole_patch();
  std::size_t hidden = 0;
  for (const Line& line : cuts.all()) {
    split(polygons[hidden], line, polygons[1 - hidden], nullptr);
    hidden = 1 - hidden;
  }
  Area area;
  accumulate(polygons[hidden], area);
  return {4 - area.size, -area.moment_a, -area.moment_b};
}

/// Visible area behind several faces, which may overlap. Each face cuts the pieces that are left by
/// the faces before it.
Area behind_many(std::span<const Cuts> faces) {
  thread_local std::vector<Polygon> pieces;
  thread_local std::vector<Polygon> left;
  pieces.assign(1, whole_patch());
  for (const Cuts& cuts : faces) {
    left.clear();
    for (Polygon& piece : pieces) {
      Polygon inside;
      Polygon outside;
      for (const Line& line : cuts.all()) {
        if (piece.size < 3) break;
        split(piece, line, inside, &outside);
        if (outside.size >= 3) left.push_back(outside);
        piece = inside;
      }
    }
    std::swap(pieces, left);
  }
  Area area;
  for (const Polygon& piece : pieces) accumulate(piece, area);
  return area;
}

}  // namespace

VisiblePart ShadowView::see(const Vector3d& center, const Vector3d& half_u,
                            const Vector3d& half_v) const {
  thread_local std::vector<Cuts> faces;
  faces.clear();
  for (const Pyramid& pyramid : pyramids_) {
    Cuts cuts;
    bool clear = false;
    for (const HalfSpace& side : pyramid) {
      const Line line{side.normal.dot(center) + side.offset, side.normal.dot(half_u),
                      side.normal.dot(half_v)};
      const double reach = std::abs(line.ka) + std::abs(line.kb);
      clear = line.k0 + reach <= 0;
      if (clear) break;
      if (line.k0 - reach < 0) cuts.lines[cuts.count++] = line;
    }
    if (clear) continue;
    if (cuts.count == 0) return {0.0, Vector3d::Zero()};
    faces.push_back(cuts);
  }
  if (faces.empty()) return {};
  const Area area = faces.size() == 1 ? behind_one(faces.front()) : behind_many(faces);
  // An area below this is rounding, and its centre may lie anywhere.
  constexpr double kNothing = 1e-12;
  if (area.size <= kNothing) return {0.0, Vector3d::Zero()};
  return {area.size / 4, area.moment_a / area.size * half_u + area.moment_b / area.size * half_v};
}

}  // namespace blindcorner
