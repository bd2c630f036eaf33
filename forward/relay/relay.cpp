// SPDX-License-Identifier: Apache-2.0
#include "forward/relay/relay.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "forward/scene/shapes/shape_geometry.h"
#include "forward/transport/gauss_legendre.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Cell in the region's own two parameters: tangents (rectangle) or polar angles (cone).
struct Cell {
  double u0, u1, v0, v1;
  bool polar;

  Vector3d direction(double u, double v) const {
    if (!polar) return direction_from_tangents(u, v);
    return {std::cos(u), -std::sin(u) * std::cos(v), -std::sin(u) * std::sin(v)};
  }
  double solid_angle() const {
    if (polar) return (std::cos(u0) - std::cos(u1)) * (v1 - v0);
    const auto corner = [](double x, double y) {
      return std::atan2(x * y, std::sqrt(1 + x * x + y * y));
    };
    return corner(u1, v1) - corner(u0, v1) - corner(u1, v0) + corner(u0, v0);
  }
  /// Solid angle per unit of the parameters, up to a constant.
  double density(double u, double v) const {
    if (polar) return std::sin(u);
    const double square = 1 + u * u + v * v;
    return 1 / (square * std::sqrt(square));
  }
  std::array<Cell, 2> halves(int along) const {
    const double u = 0.5 * (u0 + u1);
    const double v = 0.5 * (v0 + v1);
    if (along == 1) return {Cell{u0, u, v0, v1, polar}, Cell{u, u1, v0, v1, polar}};
    return {Cell{u0, u1, v0, v, polar}, Cell{u0, u1, v, v1, polar}};
  }
  std::array<Cell, 4> quarters() const {
    const double u = 0.5 * (u0 + u1);
    const double v = 0.5 * (v0 + v1);
    return {Cell{u0, u, v0, v, polar}, Cell{u, u1, v0, v, polar}, Cell{u0, u, v, v1, polar},
            Cell{u, u1, v, v1, polar}};
  }
};

class Sampler {
 public:
  Sampler(const RayScene& rays, const std::vector<Surface>& surfaces, const Vector3d& origin,
          const Eigen::Matrix3d& rotation, const RelaySampling& sampling)
      : rays_(rays),
        surfaces_(surfaces),
        origin_(origin),
        rotation_(rotation),
        sampling_(sampling) {}

  /// `parent`: the whole cell of which this cell is a half. Both see the same surface.
  void sample(const Cell& cell, int splits, int edges, const RelayPatch* parent = nullptr) {
    RelayPatch patch;
    const Trace trace = parent != nullptr ? inherit(cell, *parent, patch) : look(cell, patch);
    if (trace == Trace::mixed && edges < sampling_.edge_depth) {
      for (const Cell& quarter : cell.quarters()) sample(quarter, splits, edges + 1);
      return;
    }
    if (trace == Trace::nothing) return;
    if (trace == Trace::whole) {
      if (sampling_.points) {
        const auto [u, v] = sampling_.points(patch, places_of(cell, patch));
        if (std::max(u, v) > sampling_.most_points && splits < sampling_.split_depth) {
          for (const Cell& half : cell.halves(u >= v ? 1 : 2)) sample(half, splits + 1, edges);
          return;
        }
        const auto whole = [&](double n) {
          return static_cast<int>(std::ceil(std::clamp(n, 1.0, sampling_.most_points)));
        };
        return represent(cell, patch, whole(u), whole(v));
      }
      if (divide(cell, patch, splits, edges, &patch)) return;
      const auto [nu, nv] = sampling_.nodes ? sampling_.nodes(patch) : std::array{1, 1};
      return represent(cell, patch, nu, nv);
    }
    std::vector<RelayPatch> parts = parts_of(cell);
    for (const RelayPatch& part : parts) {
      if (divide(cell, part, splits, edges, nullptr)) return;
    }
    for (RelayPatch& part : parts) {
      part.group = group_++;
      patches.push_back(part);
    }
  }

  std::vector<RelayPatch> patches;

 private:
  enum class Trace { nothing, mixed, whole };

  /// Samples the halves of a cell if `split` asks for it and returns whether it does. `patch` is
  /// all or a part of the surface that the cell sees.
  bool divide(const Cell& cell, const RelayPatch& patch, int splits, int edges,
              const RelayPatch* whole) {
    if (splits >= sampling_.split_depth || !sampling_.split) return false;
    const int split = sampling_.split(patch);
    if (split == 0) return false;
    for (const Cell& half : cell.halves(split)) {
      sample(half, splits + 1, edges, sampling_.halves_inherit ? whole : nullptr);
    }
    return true;
  }

  /// Represents a cell by nu and nv points along its edges.
  void represent(const Cell& cell, RelayPatch& patch, int nu, int nv) {
    patch.group = group_++;
    if (nu * nv > 1) {
      add_nodes(cell, patch, gauss_legendre(nu), gauss_legendre(nv));
    } else {
      patches.push_back(patch);
    }
  }

  CellPlaces places_of(const Cell& cell, const RelayPatch& patch) const {
    CellPlaces places;
    for (std::size_t j = 0; j < 3; ++j) {
      for (std::size_t i = 0; i < 3; ++i) {
        const double a = 0.5 * static_cast<double>(i), b = 0.5 * static_cast<double>(j);
        places[j][i] =
            meet(cell, (1 - a) * cell.u0 + a * cell.u1, (1 - b) * cell.v0 + b * cell.v1, patch);
      }
    }
    return places;
  }

  /// Adds Gauss nodes. The density of the solid angle decides each node's share of it.
  void add_nodes(const Cell& cell, const RelayPatch& whole, const std::vector<QuadraturePoint>& us,
                 const std::vector<QuadraturePoint>& vs) {
    const double uc = 0.5 * (cell.u0 + cell.u1), hu = 0.5 * (cell.u1 - cell.u0);
    const double vc = 0.5 * (cell.v0 + cell.v1), hv = 0.5 * (cell.v1 - cell.v0);
    const std::size_t first = patches.size();
    double total = 0;
    for (const QuadraturePoint& pv : vs) {
      for (const QuadraturePoint& pu : us) {
        const double u = uc + pu.position * hu;
        const double v = vc + pv.position * hv;
        RelayPatch node = whole;
        node.node = true;
        node.center = meet(cell, u, v, whole);
        node.distance = (node.center - origin_).norm();
        node.solid_angle = pu.weight * pv.weight * cell.density(u, v);
        total += node.solid_angle;
        patches.push_back(node);
        if (!sampling_.node_extents) continue;
        // The node's part of the cell, as a parallelogram through the middles of the part's edges.
        const double um = uc + 0.5 * (pu.begin + pu.end) * hu;
        const double vm = vc + 0.5 * (pv.begin + pv.end) * hv;
        const Vector3d left = meet(cell, uc + pu.begin * hu, vm, whole);
        const Vector3d right = meet(cell, uc + pu.end * hu, vm, whole);
        const Vector3d low = meet(cell, um, vc + pv.begin * hv, whole);
        const Vector3d high = meet(cell, um, vc + pv.end * hv, whole);
        patches.back().half_u = 0.5 * (right - left);
        patches.back().half_v = 0.5 * (high - low);
        patches.back().area_center = 0.25 * (left + right + low + high);
      }
    }
    for (std::size_t i = first; i < patches.size(); ++i) {
      patches[i].solid_angle *= whole.solid_angle / total;
    }
  }

  /// Fills the patch of a whole cell. Returns `mixed` when centre and corners see different things.
  Trace look(const Cell& cell, RelayPatch& patch) const {
    const double uc = 0.5 * (cell.u0 + cell.u1);
    const double vc = 0.5 * (cell.v0 + cell.v1);
    const auto hit = rays_.first_hit(origin_, world(cell, uc, vc));
    if (sampling_.centers_only) {
      if (hit) fill(cell, *hit, patch);
      return hit ? Trace::whole : Trace::nothing;
    }
    const double inset_u = sampling_.edge_inset * (cell.u1 - cell.u0);
    const double inset_v = sampling_.edge_inset * (cell.v1 - cell.v0);
    const std::array<double, 2> us = {cell.u0 + inset_u, cell.u1 - inset_u};
    const std::array<double, 2> vs = {cell.v0 + inset_v, cell.v1 - inset_v};
    int same = 0;
    int missed = 0;
    for (const double u : us) {
      for (const double v : vs) {
        const auto corner = rays_.first_hit(origin_, world(cell, u, v));
        if (!corner) ++missed;
        if (corner.has_value() == hit.has_value() &&
            (!hit || (corner->surface == hit->surface && corner->normal.dot(hit->normal) > 0.999)))
          ++same;
      }
    }
    if (!hit) return missed == 4 ? Trace::nothing : Trace::mixed;
    if (same < 4) return Trace::mixed;
    fill(cell, *hit, patch);
    return Trace::whole;
  }

  /// Fills the patch of a cell that sees the same plane as its parent.
  Trace inherit(const Cell& cell, const RelayPatch& parent, RelayPatch& patch) const {
    patch = parent;
    const double uc = 0.5 * (cell.u0 + cell.u1);
    const double vc = 0.5 * (cell.v0 + cell.v1);
    patch.center = meet(cell, uc, vc, parent);
    patch.area_center = patch.center;
    patch.distance = (patch.center - origin_).norm();
    fill(cell, patch);
    return Trace::whole;
  }

  /// Fills the patch of a whole cell with the surface that its centre sees.
  void fill(const Cell& cell, const RayHit& hit, RelayPatch& patch) const {
    patch = patch_at(hit);
    fill(cell, patch);
  }

  /// Fills in extent and solid angle of a cell whose centre is known.
  void fill(const Cell& cell, RelayPatch& patch) const {
    const double uc = 0.5 * (cell.u0 + cell.u1);
    const double vc = 0.5 * (cell.v0 + cell.v1);
    patch.solid_angle = cell.solid_angle();
    patch.half_u = 0.5 * (meet(cell, cell.u1, vc, patch) - meet(cell, cell.u0, vc, patch));
    patch.half_v = 0.5 * (meet(cell, uc, cell.v1, patch) - meet(cell, uc, cell.v0, patch));
  }

  RelayPatch patch_at(const RayHit& hit) const {
    RelayPatch patch;
    patch.surface = hit.surface;
    const bool front = reflects(hit);
    const bool seen = front || two_sided(hit);
    patch.normal = seen && !front ? Vector3d(-hit.normal) : hit.normal;
    patch.center = hit.point;
    patch.area_center = hit.point;
    patch.distance = hit.distance;
    patch.albedo = seen ? surfaces_[static_cast<std::size_t>(hit.surface)].albedo : 0.0;
    return patch;
  }

  /// Divides a mixed cell into one patch for each flat surface in it. Each patch has its share of
  /// the cell and of the cell's edges. The shares are found by rays on a lattice that has a column
  /// and a row for each ray.
  std::vector<RelayPatch> parts_of(const Cell& cell) const {
    const int rays = sampling_.edge_rays;
    const int turn = static_cast<int>(std::lround(rays * (std::sqrt(5.0) - 1) / 2));  // Fibonacci
    struct Part {
      RelayPatch patch;
      double weight, u, v, uu, vv;
    };
    std::vector<Part> parts;
    double all = 0;
    for (int k = 0; k < rays; ++k) {
      const double u = (k + 0.5) / rays;
      const double v = (k * turn % rays + 0.5) / rays;
      const double cell_u = cell.u0 + u * (cell.u1 - cell.u0);
      const double cell_v = cell.v0 + v * (cell.v1 - cell.v0);
      const double weight = cell.density(cell_u, cell_v);
      all += weight;
      const auto hit = rays_.first_hit(origin_, world(cell, cell_u, cell_v));
      if (!hit) continue;
      const RelayPatch seen = patch_at(*hit);
      auto part = std::ranges::find_if(parts, [&](const Part& p) {
        return p.patch.surface == seen.surface && p.patch.normal.dot(seen.normal) > 0.999;
      });
      if (part == parts.end()) part = parts.insert(part, {seen, 0, 0, 0, 0, 0});
      part->weight += weight;
      part->u += weight * u;
      part->v += weight * v;
      part->uu += weight * u * u;
      part->vv += weight * v * v;
    }
    std::vector<RelayPatch> patches_of_parts;
    for (Part& part : parts) {
      RelayPatch& patch = part.patch;
      patch.whole = false;
      patch.solid_angle = cell.solid_angle() * part.weight / all;
      // The patch is lit evenly. Along both edges, its light has the mean and the variance of the
      // part's rays. The variance includes that of one ray's own row.
      const auto side = [&](double from, double to, double sum, double squares) {
        const double mean = sum / part.weight;
        const double own = 1.0 / (12 * rays * rays);
        const double half = std::sqrt(3 * std::max(squares / part.weight - mean * mean + own, own));
        return std::array{from + (mean - half) * (to - from), from + mean * (to - from),
                          from + (mean + half) * (to - from)};
      };
      const auto us = side(cell.u0, cell.u1, part.u, part.uu);
      const auto vs = side(cell.v0, cell.v1, part.v, part.vv);
      const RelayPatch at = patch;  // gives the plane
      patch.center = meet(cell, us[1], vs[1], at);
      patch.area_center = patch.center;
      patch.distance = (patch.center - origin_).norm();
      patch.half_u = 0.5 * (meet(cell, us[2], vs[1], at) - meet(cell, us[0], vs[1], at));
      patch.half_v = 0.5 * (meet(cell, us[1], vs[2], at) - meet(cell, us[1], vs[0], at));
      patches_of_parts.push_back(patch);
    }
    return patches_of_parts;
  }

  /// Rectangles reflect on one side only; closed shapes are seen from outside.
  bool reflects(const RayHit& hit) const { return hit.normal.dot(origin_ - hit.point) > 0; }

  bool two_sided(const RayHit& hit) const {
    return geometry_of(surfaces_[static_cast<std::size_t>(hit.surface)].shape)->two_sided();
  }

  /// Point where a direction of the cell meets the patch's plane, at most four times as far away as
  /// the patch. A direction that misses the plane keeps the patch's distance.
  Vector3d meet(const Cell& cell, double u, double v, const RelayPatch& patch) const {
    const Vector3d d = world(cell, u, v);
    const double rate = d.dot(patch.normal);
    const double reach = (patch.center - origin_).dot(patch.normal);
    const double t = reach * rate > 1e-6 * reach * reach ? reach / rate : patch.distance;
    return origin_ + std::min(t, 4 * patch.distance) * d;
  }

  Vector3d world(const Cell& cell, double u, double v) const {
    return rotation_ * cell.direction(u, v);
  }

  const RayScene& rays_;
  const std::vector<Surface>& surfaces_;
  Vector3d origin_;
  Eigen::Matrix3d rotation_;
  const RelaySampling& sampling_;
  int group_ = 0;
};

}  // namespace

std::pair<Vector3d, Vector3d> surface_axes(const Vector3d& normal) {
  Vector3d u = Vector3d::UnitZ().cross(normal);
  if (u.norm() < 1e-6) u = Vector3d::UnitX();
  u.normalize();
  return {u, normal.cross(u)};
}

double solid_angle(const FieldOfIllumination& region) {
  if (const auto* r = std::get_if<AngularRectangle>(&region)) {
    return Cell{std::tan(r->left), std::tan(r->right), std::tan(r->top), std::tan(r->bottom), false}
        .solid_angle();
  }
  return 2 * kPi * (1 - std::cos(std::get<AngularCone>(region).half_angle));
}

bool contains(const FieldOfIllumination& region, const Vector3d& direction) {
  if (direction.x() <= 0) return false;
  if (const auto* r = std::get_if<AngularRectangle>(&region)) {
    const double right = std::atan2(-direction.y(), direction.x());
    const double down = std::atan2(-direction.z(), direction.x());
    return right >= r->left && right <= r->right && down >= r->top && down <= r->bottom;
  }
  return direction.x() >= std::cos(std::get<AngularCone>(region).half_angle) * direction.norm();
}

std::vector<RelayPatch> sample_region(const RayScene& rays, const std::vector<Surface>& surfaces,
                                      const Vector3d& origin, const Eigen::Matrix3d& rotation,
                                      const FieldOfIllumination& region,
                                      const RelaySampling& sampling) {
  Sampler sampler(rays, surfaces, origin, rotation, sampling);
  const int n = sampling.divisions;
  if (const auto* r = std::get_if<AngularRectangle>(&region)) {
    const double u0 = std::tan(r->left), u1 = std::tan(r->right);
    const double v0 = std::tan(r->top), v1 = std::tan(r->bottom);
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        sampler.sample({u0 + (u1 - u0) * i / n, u0 + (u1 - u0) * (i + 1) / n,
                        v0 + (v1 - v0) * j / n, v0 + (v1 - v0) * (j + 1) / n, false},
                       0, 0);
      }
    }
  } else {
    // Rings of equal width with 3 (2 ring + 1) sectors: cells of equal size and nearly square. A
    // single ring has four sectors.
    const double half = std::get<AngularCone>(region).half_angle;
    for (int ring = 0; ring < n; ++ring) {
      const int sectors = n == 1 ? 4 : 3 * (2 * ring + 1);
      for (int s = 0; s < sectors; ++s) {
        sampler.sample({half * ring / n, half * (ring + 1) / n, 2 * kPi * s / sectors,
                        2 * kPi * (s + 1) / sectors, true},
                       0, 0);
      }
    }
  }
  return std::move(sampler.patches);
}

RelayPatch relay_point_patch(const std::vector<Surface>& surfaces, const Vector3d& point,
                             double tolerance) {
  RelayPatch patch;
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    if (!surfaces[i].relay) continue;
    for (const auto& quad : flat_faces(surfaces[i].shape, surfaces[i].T_world_surface, 1.0)) {
      const Vector3d normal = face_normal(quad);
      // Distance to the face itself, not to its plane.
      const Vector3d u = quad[1] - quad[0];
      const Vector3d v = quad[3] - quad[0];
      const double a = std::clamp(u.dot(point - quad[0]) / u.squaredNorm(), 0.0, 1.0);
      const double b = std::clamp(v.dot(point - quad[0]) / v.squaredNorm(), 0.0, 1.0);
      const double distance = (point - quad[0] - a * u - b * v).norm();
      if (distance < best) {
        best = distance;
        patch.surface = static_cast<int>(i);
        patch.normal = normal;
        patch.albedo = surfaces[i].albedo;
      }
    }
  }
  if (!(best <= tolerance)) {
    throw Error("relay point", "found " + std::to_string(best) +
                                   " m from any relay surface, accepted: at most " +
                                   std::to_string(tolerance) + " m");
  }
  patch.center = point;
  patch.area_center = point;
  patch.solid_angle = 1.0;
  return patch;
}

}  // namespace blindcorner
