// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/lobe_field.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/scene/shape.h"
#include "forward/relay/relay.h"
#include "forward/scene/shapes/shape_geometry.h"
#include "forward/support/clip.h"
#include "forward/support/multiversion.h"
#include "forward/transport/normal_density.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Beyond this many standard deviations, an edge is out of the lobe's reach (it cuts off 1e-9 of
/// the lobe).
constexpr double kReach = 6;
/// No relay is farther away than this, m: scenes end at 100 km (forward/scene/limits.h).
constexpr double kFarthest = 1e6;
using Lane = std::array<double, LobeField::kChunk>;

/// Hermite coefficients of the part of a standard normal distribution z in the plane that lies in a
/// region: share, mean of z, and mean of z z' - 1, not divided by the share.
struct alignas(64) Moments {
  Lane m, a, c, aa, ac, cc;
};

/// Axes along and across the relay's tilt, at right angles to each direction, and the lobe in these
/// axes.
struct alignas(64) Frame {
  Lane ax, ay, az, cx, cy, cz;
  Lane la, lb, lc;  ///< offset sideways over the distance: (la z1, lb z1 + lc z2)
  Lane oa, oc;      ///< change of the way out along z1 and z2, m
  Lane ra, rc;      ///< relative change of the distance along z1 and z2, in the patch's plane
  Lane ga, gc;      ///< relative change of the outgoing light along z1 and z2
  Lane rest;        ///< remaining variance of the way out, m^2
};

/// An edge for each direction: sine of the angle to the edge (positive inside), and the sine's
/// gradient.
struct alignas(64) EdgeLanes {
  Lane distance, along, across;
};

/// Normal distribution function by Abramowitz and Stegun 26.2.17, good to 8e-8.
inline double normal_below(double x, double density) {
  const double t = 1 / (1 + 0.2316419 * std::abs(x));
  const double above =
      density *
      (t * (0.319381530 +
            t * (-0.356563782 + t * (1.781477937 + t * (-1.821255978 + t * 1.330274429)))));
  return x >= 0 ? 1 - above : above;
}

void fill(Moments& m, std::size_t n, double share) {
  std::fill_n(m.m.begin(), n, share);
  for (Lane* lane : {&m.a, &m.c, &m.aa, &m.ac, &m.cc}) std::fill_n(lane->begin(), n, 0.0);
}

BLINDCORNER_MULTIVERSION void make_frame(const LobeRays& rays, std::size_t n,
                                         const Vector3d& normal, const Vector3d& in_plane,
                                         double variance, Frame& f) {
  const double nx = normal.x(), ny = normal.y(), nz = normal.z();
  const double mx = rays.normal.x(), my = rays.normal.y(), mz = rays.normal.z();
  const double ex = in_plane.x(), ey = in_plane.y(), ez = in_plane.z();
  BLINDCORNER_INDEPENDENT
  for (std::size_t i = 0; i < n; ++i) {
    const double dx = rays.x[i], dy = rays.y[i], dz = rays.z[i];
    const double dn = dx * nx + dy * ny + dz * nz;
    const double de = dx * ex + dy * ey + dz * ez;
    // If the plane is seen head on, any direction in the plane will do.
    const bool flat = 1 - dn * dn < 1e-10;
    const double tx = flat ? ex - de * dx : nx - dn * dx;
    const double ty = flat ? ey - de * dy : ny - dn * dy;
    const double tz = flat ? ez - de * dz : nz - dn * dz;
    const double inverse = 1 / std::sqrt(tx * tx + ty * ty + tz * tz);
    const double ax = tx * inverse, ay = ty * inverse, az = tz * inverse;
    const double cx = dy * az - dz * ay, cy = dz * ax - dx * az, cz = dx * ay - dy * ax;
    // Covariance of the patch's own extent in angles, and its covariance with the change of the way
    // out.
    const double r = rays.distance[i];
    const double share = rays.extent[i];
    const double turn = share / (r * r);
    const double ux = rays.ux[i], uy = rays.uy[i], uz = rays.uz[i];
    const double vx = rays.vx[i], vy = rays.vy[i], vz = rays.vz[i];
    const double ua = ux * ax + uy * ay + uz * az, uc = ux * cx + uy * cy + uz * cz;
    const double va = vx * ax + vy * ay + vz * az, vc = vx * cx + vy * cy + vz * cz;
    const double gx = dx + rays.lx[i], gy = dy + rays.ly[i], gz = dz + rays.lz[i];
    const double gu = gx * ux + gy * uy + gz * uz, gv = gx * vx + gy * vy + gz * vz;
    // The outgoing light changes like (d . m) (d . n) / r^2, where m is the object's normal. The
    // cosine d . m is bounded, by judgement: faces seen from within 3 degrees send hardly any
    // light.
    const double dm = std::max(dx * mx + dy * my + dz * mz, 0.05);
    const double bx = mx / dm - 4 * dx, by = my / dm - 4 * dy, bz = mz / dm - 4 * dz;
    const double bu = bx * ux + by * uy + bz * uz, bv = bx * vx + by * vy + bz * vz;
    const double caa = variance + turn * (ua * ua + va * va);
    const double cac = turn * (ua * uc + va * vc);
    const double ccc = variance + turn * (uc * uc + vc * vc);
    const double la = std::sqrt(caa);
    const double lb = cac / la;
    const double lc = std::sqrt(ccc - lb * lb);
    const double oa = share / r * (gu * ua + gv * va) / la;
    const double oc = (share / r * (gu * uc + gv * vc) - lb * oa) / lc;
    f.ax[i] = ax, f.ay[i] = ay, f.az[i] = az;
    f.cx[i] = cx, f.cy[i] = cy, f.cz[i] = cz;
    f.la[i] = la, f.lb[i] = lb, f.lc[i] = lc;
    f.oa[i] = oa, f.oc[i] = oc;
    const double ud = ux * dx + uy * dy + uz * dz, vd = vx * dx + vy * dy + vz * dz;
    const double ra = turn * (ud * ua + vd * va) / la;
    f.ra[i] = ra;
    f.rc[i] = (turn * (ud * uc + vd * vc) - lb * ra) / lc;
    const double ga = turn * (bu * ua + bv * va) / la;
    f.ga[i] = ga;
    f.gc[i] = (turn * (bu * uc + bv * vc) - lb * ga) / lc;
    f.rest[i] = std::max(share * (gu * gu + gv * gv) - oa * oa - oc * oc, 0.0);
  }
}

/// A straight edge, given by the inward normal of the plane through the edge and the object.
BLINDCORNER_MULTIVERSION void straight_edge(const LobeRays& rays, std::size_t n, const Frame& f,
                                            const Vector3d& inward, EdgeLanes& edge) {
  const double x = inward.x(), y = inward.y(), z = inward.z();
  BLINDCORNER_INDEPENDENT
  for (std::size_t i = 0; i < n; ++i) {
    edge.distance[i] = x * rays.x[i] + y * rays.y[i] + z * rays.z[i];
    edge.along[i] = x * f.ax[i] + y * f.ay[i] + z * f.az[i];
    edge.across[i] = x * f.cx[i] + y * f.cy[i] + z * f.cz[i];
  }
}

/// The edge of a cone of light about `axis` from `apex` (relative to the object), cut by the plane
/// at `height`. `edge` receives the distance to the rim from the point where the direction meets
/// the plane, and the change of this distance as the direction turns.
BLINDCORNER_MULTIVERSION void cone_edge(const LobeRays& rays, std::size_t n, const Frame& f,
                                        const Vector3d& apex, const Vector3d& axis, double tangent,
                                        const Vector3d& normal, double height, EdgeLanes& edge) {
  const double nx = normal.x(), ny = normal.y(), nz = normal.z();
  const double x = axis.x(), y = axis.y(), z = axis.z();
  BLINDCORNER_INDEPENDENT
  for (std::size_t i = 0; i < n; ++i) {
    const double dx = rays.x[i], dy = rays.y[i], dz = rays.z[i];
    const double dn = dx * nx + dy * ny + dz * nz;
    const double t = height / dn;
    const double wx = t * dx - apex.x(), wy = t * dy - apex.y(), wz = t * dz - apex.z();
    const double axial = wx * x + wy * y + wz * z;
    const double px = wx - axial * x, py = wy - axial * y, pz = wz - axial * z;
    const double off = std::sqrt(px * px + py * py + pz * pz) + 1e-300;
    const double gx = tangent * x - px / off, gy = tangent * y - py / off,
                 gz = tangent * z - pz / off;
    const double gd = gx * dx + gy * dy + gz * dz;
    const double na = nx * f.ax[i] + ny * f.ay[i] + nz * f.az[i];
    edge.distance[i] = t > 0 ? tangent * axial - off : -1e9 * height * height;
    edge.along[i] = t * (gx * f.ax[i] + gy * f.ay[i] + gz * f.az[i] - na / dn * gd);
    edge.across[i] = t * (gx * f.cx[i] + gy * f.cy[i] + gz * f.cz[i]);
  }
}

/// Removes the part outside of an edge from the moments.
BLINDCORNER_MULTIVERSION void cut_edge(std::size_t n, double sigma, const EdgeLanes& edge,
                                       Moments& moments) {
  BLINDCORNER_INDEPENDENT
  for (std::size_t i = 0; i < n; ++i) {
    const double wa = edge.along[i];
    const double wc = edge.across[i];
    const double inverse = 1 / (std::sqrt(wa * wa + wc * wc) + 1e-300);
    const double x = std::min(std::max(edge.distance[i] * inverse / sigma, -kReach), kReach);
    const double a = wa * inverse, c = wc * inverse;
    const double density = normal_density(x);
    const double slope = x * density;
    moments.m[i] += normal_below(x, density) - 1;
    moments.a[i] += density * a;
    moments.c[i] += density * c;
    moments.aa[i] -= slope * a * a;
    moments.ac[i] -= slope * a * c;
    moments.cc[i] -= slope * c * c;
  }
}

/// Product of two Hermite series, which gives the intersection of two regions.
BLINDCORNER_MULTIVERSION void intersect(std::size_t n, const Moments& by, Moments& into) {
  BLINDCORNER_INDEPENDENT
  for (std::size_t i = 0; i < n; ++i) {
    const double m = into.m[i], a = into.a[i], c = into.c[i];
    const double aa = into.aa[i], ac = into.ac[i], cc = into.cc[i];
    const double m2 = std::max(by.m[i], 0.0), a2 = by.a[i], c2 = by.c[i];
    const double aa2 = by.aa[i], ac2 = by.ac[i], cc2 = by.cc[i];
    into.m[i] = std::max(m * m2 + a * a2 + c * c2 + 0.5 * (aa * aa2 + cc * cc2) + ac * ac2, 0.0);
    into.a[i] = m * a2 + a * m2 + aa * a2 + ac * c2 + aa2 * a + ac2 * c;
    into.c[i] = m * c2 + c * m2 + ac * a2 + cc * c2 + ac2 * a + cc2 * c;
    into.aa[i] = m * aa2 + aa * m2 + 2 * a * a2 + 2 * (aa * aa2 + ac * ac2);
    into.ac[i] = m * ac2 + ac * m2 + a * c2 + c * a2 + aa * ac2 + ac * cc2 + ac * aa2 + cc * ac2;
    into.cc[i] = m * cc2 + cc * m2 + 2 * c * c2 + 2 * (ac * ac2 + cc * cc2);
  }
}

BLINDCORNER_MULTIVERSION void subtract(std::size_t n, const Moments& what, Moments& from) {
  BLINDCORNER_INDEPENDENT
  for (std::size_t i = 0; i < n; ++i) {
    from.m[i] -= what.m[i];
    from.a[i] -= what.a[i];
    from.c[i] -= what.c[i];
    from.aa[i] -= what.aa[i];
    from.ac[i] -= what.ac[i];
    from.cc[i] -= what.cc[i];
  }
}

/// Light on a plane: `radiance` over the cube of the distance to the source. `source` is the
/// source's position relative to the object.
struct LitPlane {
  Vector3d normal, source;
  double height, radiance;
};

/// Adds radiance and path over the remaining part of the lobe.
BLINDCORNER_MULTIVERSION void add_light(const LobeRays& rays, std::size_t n, const Frame& f,
                                        const Moments& left, const LitPlane& plane,
                                        const LobeSums& sums) {
  const double nx = plane.normal.x(), ny = plane.normal.y(), nz = plane.normal.z();
  const double sx = plane.source.x(), sy = plane.source.y(), sz = plane.source.z();
  double* __restrict weights = sums.weight;
  double* __restrict firsts = sums.first;
  double* __restrict seconds = sums.second;
  BLINDCORNER_INDEPENDENT
  for (std::size_t i = 0; i < n; ++i) {
    const double share = left.m[i];
    const double inverse = share > 1e-9 ? 1 / share : 0;
    const double mean_a = std::min(std::max(left.a[i] * inverse, -kReach), kReach);
    const double mean_c = std::min(std::max(left.c[i] * inverse, -kReach), kReach);
    const double var_a = std::min(std::max(1 + left.aa[i] * inverse - mean_a * mean_a, 1e-4), 4.0);
    const double var_c = std::min(std::max(1 + left.cc[i] * inverse - mean_c * mean_c, 1e-4), 4.0);
    const double spread = std::sqrt(var_a);
    const double bound = std::sqrt(var_c);
    const double joint =
        std::min(std::max((left.ac[i] * inverse - mean_a * mean_c) / spread, -bound), bound);
    const double var_rest = var_c - joint * joint;
    // Light from the point `za` along the tilt and `zc` across it, the mean that goes with `za`.
    const auto part = [&](double za, double zc, double& first, double& second) {
      const double along = f.la[i] * za;
      const double across = f.lb[i] * za + f.lc[i] * zc;
      const double ahead = 1 + f.ra[i] * za + f.rc[i] * zc;
      const double x = ahead * rays.x[i] + along * f.ax[i] + across * f.cx[i];
      const double y = ahead * rays.y[i] + along * f.ay[i] + across * f.cy[i];
      const double z = ahead * rays.z[i] + along * f.az[i] + across * f.cz[i];
      const double t = plane.height / (nx * x + ny * y + nz * z);
      const double px = t * x, py = t * y, pz = t * z;
      const double wx = px - sx, wy = py - sy, wz = pz - sz;
      const double d2 = wx * wx + wy * wy + wz * wz;
      const double d = std::sqrt(d2);
      const double r = std::sqrt(px * px + py * py + pz * pz);
      const double path = rays.path[i] + f.oa[i] * za + f.oc[i] * zc + d + r;
      // A turn across the tilt moves p by r at right angles to the ray.
      const double change =
          f.oc[i] + f.lc[i] * r * (wx * f.cx[i] + wy * f.cy[i] + wz * f.cz[i]) / d;
      const bool meets = t > 0 && t < kFarthest;
      const double out = std::max(1 + f.ga[i] * za + f.gc[i] * zc, 0.0);
      const double light = meets ? 0.5 * share * out * plane.radiance / (d2 * d) : 0.0;
      first += meets ? light * path : 0.0;
      second += meets ? light * (path * path + f.rest[i] + change * change * var_rest) : 0.0;
      return light;
    };
    double first = 0, second = 0;
    double weight = part(mean_a - spread, mean_c - joint, first, second);
    weight += part(mean_a + spread, mean_c + joint, first, second);
    weights[i] += weight;
    firsts[i] += first;
    seconds[i] += second;
  }
}

/// Corners of a rectangular field's directions in the sensor's frame, in order.
std::vector<Vector3d> corners_of(const AngularRectangle& field) {
  const auto corner = [](double right, double down) {
    return direction_from_tangents(std::tan(right), std::tan(down));
  };
  return {corner(field.left, field.top), corner(field.right, field.top),
          corner(field.right, field.bottom), corner(field.left, field.bottom)};
}

/// The part of a polygon inside a convex pyramid of rays from `apex`.
std::vector<Vector3d> clip_by_pyramid(std::vector<Vector3d> polygon, const Vector3d& apex,
                                      const std::vector<Vector3d>& rays) {
  Vector3d middle = Vector3d::Zero();
  for (const Vector3d& ray : rays) middle += ray.normalized();
  for (std::size_t i = 0; i < rays.size() && polygon.size() > 2; ++i) {
    Vector3d inward = rays[i].cross(rays[(i + 1) % rays.size()]);
    const double length = inward.norm();
    if (!(length > 0)) continue;
    inward /= inward.dot(middle) < 0 ? -length : length;
    polygon = clip(polygon, apex, inward);
  }
  return polygon;
}

Vector3d vector_area(const std::vector<Vector3d>& polygon) {
  Vector3d sum = Vector3d::Zero();
  for (std::size_t i = 2; i < polygon.size(); ++i) {
    sum += 0.5 * (polygon[i - 1] - polygon[0]).cross(polygon[i] - polygon[0]);
  }
  return sum;
}

bool has_area(const std::vector<Vector3d>& polygon) {
  double reach = 0;
  for (const Vector3d& p : polygon) reach = std::max(reach, (p - polygon[0]).norm());
  return polygon.size() > 2 && vector_area(polygon).norm() > 1e-9 * reach * reach;
}

/// Whether two faces share an edge.
bool adjacent(const OccluderFace& a, const OccluderFace& b) {
  int shared = 0;
  for (const Vector3d& p : a.corners) {
    shared += std::ranges::any_of(b.corners,
                                  [&](const Vector3d& q) { return (p - q).squaredNorm() < 1e-18; })
                  ? 1
                  : 0;
  }
  return shared >= 2;
}

}  // namespace

LobeRays LobeRays::from(std::size_t n) const {
  return {x + n,  y + n,  z + n,  distance + n, path + n, extent + n, lx + n, ly + n,
          lz + n, ux + n, uy + n, uz + n,       vx + n,   vy + n,     vz + n, normal};
}

/// Pairs edges that face each other, the most opposite ones first.
LobeField::Outline LobeField::outline(Corners corners, const Vector3d& normal) {
  // Clipping can leave several corners at the same place.
  double reach = 0;
  for (const Vector3d& p : corners) reach = std::max(reach, (p - corners[0]).norm());
  Corners kept;
  for (const Vector3d& p : corners) {
    if (kept.empty() || (p - kept.back()).norm() > 1e-9 * reach) kept.push_back(p);
  }
  if (kept.size() > 1 && (kept.front() - kept.back()).norm() <= 1e-9 * reach) kept.pop_back();
  const auto count = static_cast<int>(kept.size());
  const auto corner = [&](int i) { return kept[static_cast<std::size_t>(i % count)]; };
  std::vector<Vector3d> across;
  for (int i = 0; i < count; ++i) {
    across.push_back(normal.cross(corner(i + 1) - corner(i)).normalized());
  }
  // Two edges are opposite if the cosine of the angle between their normals is below this. By
  // judgement, this means more than 107 degrees; edges that meet at right angles are not opposite.
  constexpr double kOpposite = -0.3;
  std::vector<bool> taken(across.size(), false);
  Sides sides;
  while (true) {
    double best = kOpposite;
    std::pair<int, int> pair(-1, -1);
    for (int i = 0; i < count; ++i) {
      for (int j = i + 1; j < count; ++j) {
        const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
        const double cosine = across[a].dot(across[b]);
        if (taken[a] || taken[b] || cosine >= best) continue;
        best = cosine;
        pair = {i, j};
      }
    }
    if (pair.first < 0) break;
    sides.push_back(pair);
    taken[static_cast<std::size_t>(pair.first)] = true;
    taken[static_cast<std::size_t>(pair.second)] = true;
  }
  for (int i = 0; i < count; ++i) {
    if (!taken[static_cast<std::size_t>(i)]) sides.emplace_back(i, -1);
  }
  return {std::move(kept), std::move(sides)};
}

LobeField::LobeField(const Scene& scene, const SensorPlacement& placement)
    : source_(placement.T_world_sensor * scene.sensor.light_offset),
      axis_(placement.T_world_sensor.linear().col(0)),
      sigma_(std::get<RetroreflectiveMaterial>(scene.hidden.material).lobe_sigma),
      intensity_(scene.sensor.radiant_intensity) {
  const auto rays_of = [&](const AngularRectangle& field) {
    std::vector<Vector3d> rays = corners_of(field);
    for (Vector3d& ray : rays) ray = placement.T_world_sensor.linear() * ray;
    return rays;
  };
  const Sensor& sensor = scene.sensor;
  if (sensor.illumination == Illumination::confocal) {
    for (int z = 0; z < sensor.zone_count(); ++z) {
      const auto& footprint = sensor.zones[static_cast<std::size_t>(z)].footprint;
      if (const auto* r = std::get_if<AngularRectangle>(&footprint)) {
        add_lit(scene, rays_of(*r), z);
      }
    }
  } else if (const auto* r = std::get_if<AngularRectangle>(&sensor.field)) {
    add_lit(scene, rays_of(*r), -1);
  } else {
    cone_tangent_ = std::tan(std::get<AngularCone>(sensor.field).half_angle);
    add_lit(scene, {}, -1);
  }
  cast_shadows(scene);
}

void LobeField::add_lit(const Scene& scene, const std::vector<Vector3d>& rays, int zone) {
  for (const Surface& surface : scene.surfaces) {
    if (!surface.relay || surface.albedo <= 0) continue;
    const bool outer_only = is_closed(surface.shape) && !geometry_of(surface.shape)->two_sided();
    for (const auto& quad : flat_faces(surface.shape, surface.T_world_surface, 1.0)) {
      LitPolygon lit;
      lit.zone = zone;
      lit.albedo = surface.albedo;
      lit.normal = face_normal(quad);
      if (outer_only && lit.normal.dot(source_ - quad[0]) <= 0) continue;
      Corners corners(quad.begin(), quad.end());
      if (!rays.empty()) corners = clip_by_pyramid(corners, source_, rays);
      if (!has_area(corners)) continue;
      lit.outline = outline(std::move(corners), lit.normal);
      polygons_.push_back(std::move(lit));
    }
  }
}

/// Finds the parts of the lit polygons that other surfaces hide from the source.
void LobeField::cast_shadows(const Scene& scene) {
  for (const Surface& surface : scene.surfaces) {
    const bool closed = is_closed(surface.shape);
    const auto faces = flat_faces(surface.shape, surface.T_world_surface, 1.0);
    for (LitPolygon& lit : polygons_) {
      std::vector<Outline> shadow;
      for (const auto& face : faces) {
        const Vector3d normal = face_normal(face);
        const double side = normal.dot(source_ - face[0]);
        if (std::abs(side) < 1e-9 || (closed && side < 0)) continue;
        // The part of the polygon that lies beyond the face by more than rounding. A face in the
        // polygon's own plane hides nothing.
        const Vector3d beyond = side > 0 ? Vector3d(-normal) : normal;
        Corners corners = clip(lit.outline.corners, face[0] + 1e-6 * beyond, beyond);
        std::vector<Vector3d> rays;
        for (const Vector3d& corner : face) rays.push_back(corner - source_);
        if (corners.size() > 2) corners = clip_by_pyramid(std::move(corners), source_, rays);
        if (has_area(corners)) shadow.push_back(outline(std::move(corners), lit.normal));
      }
      if (!shadow.empty()) lit.shadows.push_back(std::move(shadow));
    }
  }
}

/// The chunk of directions in progress.
struct LobeField::View::Chunk {
  LobeRays rays{};
  std::size_t count = 0;
  Vector3d middle = Vector3d::Zero();
  double radius = 0;  ///< of the directions about their middle
  double sigma = 0;   ///< of the lobe
  Frame frame;
  EdgeLanes edge;
  Moments strip, region, light, body;

  void take(const LobeRays& some, std::size_t n) {
    rays = some;
    count = n;
    middle.setZero();
    for (std::size_t i = 0; i < count; ++i) middle += Vector3d(rays.x[i], rays.y[i], rays.z[i]);
    middle /= static_cast<double>(count);
    double square = 0;
    for (std::size_t i = 0; i < count; ++i) {
      square = std::max(square, (Vector3d(rays.x[i], rays.y[i], rays.z[i]) - middle).squaredNorm());
    }
    radius = std::sqrt(square);
  }
  bool outside(const Vector3d& inward) const {
    return inward.dot(middle) + radius < -kReach * sigma;
  }
  bool inside(const Vector3d& inward) const { return inward.dot(middle) - radius > kReach * sigma; }
  void cut(const Vector3d& inward) {
    straight_edge(rays, count, frame, inward, edge);
    cut_edge(count, sigma, edge, strip);
  }
};

/// Strips of a region with the given corners, as seen from the origin.
LobeField::View::Region LobeField::View::add_region(const std::vector<Vector3d>& corners,
                                                    const std::vector<std::pair<int, int>>& sides) {
  Vector3d center = Vector3d::Zero();
  for (const Vector3d& c : corners) center += c;
  center = center / static_cast<double>(corners.size()) - origin_;
  const auto inward = [&](int edge) {
    const auto i = static_cast<std::size_t>(edge);
    const Vector3d normal =
        (corners[i] - origin_).cross(corners[(i + 1) % corners.size()] - origin_).normalized();
    return Vector3d(normal.dot(center) < 0 ? -normal : normal);
  };
  Region region;
  region.first = strips_.size();
  for (const auto& [low, high] : sides) {
    Strip strip;
    strip.low = inward(low);
    strip.closed = high >= 0;
    strip.high = strip.closed ? inward(high) : strip.low;
    strips_.push_back(strip);
  }
  region.end = strips_.size();
  return region;
}

LobeField::View LobeField::seen_from(const Vector3d& origin,
                                     const std::vector<OccluderFace>& occluders) const {
  View view;
  view.origin_ = origin;
  view.source_ = source_;
  view.axis_ = axis_;
  view.sigma_ = sigma_;
  view.cone_tangent_ = cone_tangent_;
  for (const LitPolygon& lit : polygons_) {
    const Vector3d& corner = lit.outline.corners.front();
    const double side = lit.normal.dot(origin - corner);
    const double lit_side = lit.normal.dot(source_ - corner);
    // Light has to fall on the side that the object sees.
    if (side * lit_side <= 0) continue;
    View::Polygon polygon;
    polygon.zone = lit.zone;
    polygon.radiance = intensity_ * lit.albedo / kPi * std::abs(lit_side);
    polygon.normal = lit.normal;
    polygon.height = -side;
    polygon.region = view.add_region(lit.outline.corners, lit.outline.sides);
    polygon.bodies.first = view.bodies_.size();
    for (const std::vector<Outline>& shadow : lit.shadows) {
      View::Body body{view.regions_.size(), 0};
      for (const Outline& part : shadow) {
        view.regions_.push_back(view.add_region(part.corners, part.sides));
      }
      body.end = view.regions_.size();
      view.bodies_.push_back(body);
    }
    polygon.occluders = view.bodies_.size();
    std::size_t last = occluders.size();  // last face that counted before this one
    for (std::size_t i = 0; i < occluders.size(); ++i) {
      const OccluderFace& face = occluders[i];
      const auto& c = face.corners;
      const Vector3d normal = face_normal(c);
      const double seen = normal.dot(origin - c[0]);
      if (std::abs(seen) < 1e-9 || (face.one_sided && seen < 0)) continue;
      // The part of the face on the object's side of the polygon's plane.
      Corners corners = clip({c.begin(), c.end()}, corner, side > 0 ? lit.normal : -lit.normal);
      if (!has_area(corners)) continue;
      const Outline part = outline(std::move(corners), normal);
      const bool joins = last < i && adjacent(occluders[last], face);
      view.regions_.push_back(view.add_region(part.corners, part.sides));
      if (joins) {
        view.bodies_.back().end = view.regions_.size();
      } else {
        view.bodies_.push_back({view.regions_.size() - 1, view.regions_.size()});
      }
      last = i;
    }
    polygon.bodies.end = view.bodies_.size();
    view.polygons_.push_back(polygon);
  }
  return view;
}

bool LobeField::View::reaches(const Region& region, const Chunk& chunk) const {
  for (std::size_t s = region.first; s < region.end; ++s) {
    const Strip& strip = strips_[s];
    if (chunk.outside(strip.low) || (strip.closed && chunk.outside(strip.high))) return false;
  }
  return true;
}

/// Writes the moments inside a region to chunk.region.
void LobeField::View::cut(const Region& region, Chunk& chunk) const {
  fill(chunk.region, chunk.count, 1);
  bool whole = true;
  for (std::size_t s = region.first; s < region.end; ++s) {
    const Strip& strip = strips_[s];
    const bool low = !chunk.inside(strip.low);
    const bool high = strip.closed && !chunk.inside(strip.high);
    if (!low && !high) continue;
    fill(chunk.strip, chunk.count, 1);
    if (low) chunk.cut(strip.low);
    if (high) chunk.cut(strip.high);
    if (whole) {
      chunk.region = chunk.strip;
      for (std::size_t i = 0; i < chunk.count; ++i) {
        chunk.region.m[i] = std::max(chunk.region.m[i], 0.0);
      }
      whole = false;
    } else {
      intersect(chunk.count, chunk.strip, chunk.region);
    }
  }
}

/// Removes from the moments in chunk.light the parts that the bodies [first, end) hide. Returns
/// whether any body reaches the lobes.
bool LobeField::View::shade(std::size_t first, std::size_t end, Chunk& chunk) const {
  bool any = false;
  for (std::size_t b = first; b < end; ++b) {
    bool touched = false;
    for (std::size_t r = bodies_[b].first; r < bodies_[b].end; ++r) {
      if (!reaches(regions_[r], chunk)) continue;
      cut(regions_[r], chunk);
      if (!touched) fill(chunk.body, chunk.count, 1);
      touched = true;
      subtract(chunk.count, chunk.region, chunk.body);
    }
    if (touched) intersect(chunk.count, chunk.body, chunk.light);
    any = any || touched;
  }
  return any;
}

bool LobeField::View::shadow_near(const Chunk& chunk, int zone) const {
  return std::ranges::any_of(polygons_, [&](const Polygon& polygon) {
    if (polygon.zone >= 0 && polygon.zone != zone) return false;
    for (std::size_t b = polygon.occluders; b < polygon.bodies.end; ++b) {
      for (std::size_t r = bodies_[b].first; r < bodies_[b].end; ++r) {
        if (reaches(regions_[r], chunk)) return true;
      }
    }
    return false;
  });
}

/// Writes the moments of the lobes' part that the polygon's light fills to chunk.light, without
/// occluders. Returns whether the lobes reach the polygon at all.
bool LobeField::View::fill_light(const Polygon& polygon, Chunk& chunk) const {
  if (!reaches(polygon.region, chunk)) return false;
  make_frame(chunk.rays, chunk.count, polygon.normal, polygon.normal.unitOrthogonal(),
             sigma_ * sigma_, chunk.frame);
  cut(polygon.region, chunk);
  chunk.light = chunk.region;
  if (cone_tangent_ > 0) {
    fill(chunk.strip, chunk.count, 1);
    cone_edge(chunk.rays, chunk.count, chunk.frame, source_ - origin_, axis_, cone_tangent_,
              polygon.normal, polygon.height, chunk.edge);
    cut_edge(chunk.count, sigma_, chunk.edge, chunk.strip);
    intersect(chunk.count, chunk.strip, chunk.light);
  }
  shade(polygon.bodies.first, polygon.occluders, chunk);
  return true;
}

void LobeField::View::gather(const LobeRays& rays, std::size_t count, int zone,
                             const LobeSums& sums) const {
  Chunk chunk;
  chunk.sigma = sigma_;
  for (std::size_t begin = 0; begin < count; begin += kChunk) {
    chunk.take(rays.from(begin), std::min(kChunk, count - begin));
    for (const Polygon& polygon : polygons_) {
      if (polygon.zone >= 0 && polygon.zone != zone) continue;
      if (!fill_light(polygon, chunk)) continue;
      shade(polygon.occluders, polygon.bodies.end, chunk);
      add_light(chunk.rays, chunk.count, chunk.frame, chunk.light,
                {polygon.normal, source_ - origin_, polygon.height, polygon.radiance},
                sums.from(begin));
    }
  }
}

bool LobeField::View::gather_shaded(const LobeRays& rays, std::size_t count, int zone,
                                    const LobeSums& open, const LobeSums& shaded) const {
  Chunk chunk;
  chunk.sigma = sigma_;
  chunk.take(rays, count);
  if (!shadow_near(chunk, zone)) return false;
  struct alignas(64) Own {
    Lane weight{}, first{}, second{};
  };
  const auto add = [&](const Own& from, const LobeSums& to) {
    for (std::size_t i = 0; i < count; ++i) {
      to.weight[i] += from.weight[i];
      to.first[i] += from.first[i];
      to.second[i] += from.second[i];
    }
  };
  for (const Polygon& polygon : polygons_) {
    if (polygon.zone >= 0 && polygon.zone != zone) continue;
    if (!fill_light(polygon, chunk)) continue;
    const LitPlane plane{polygon.normal, source_ - origin_, polygon.height, polygon.radiance};
    Own own;
    add_light(chunk.rays, count, chunk.frame, chunk.light, plane,
              {own.weight.data(), own.first.data(), own.second.data()});
    add(own, open);
    if (shade(polygon.occluders, polygon.bodies.end, chunk)) {
      add_light(chunk.rays, count, chunk.frame, chunk.light, plane, shaded);
    } else {
      add(own, shaded);
    }
  }
  return true;
}

}  // namespace blindcorner
