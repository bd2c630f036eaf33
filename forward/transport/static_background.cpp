// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/static_background.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <optional>

#include "blindcorner/forward/constants.h"
#include "forward/support/clip.h"
#include "forward/support/multiversion.h"
#include "forward/support/parallel.h"
#include "forward/transport/known_patches.h"

namespace blindcorner {

std::vector<OccluderFace> known_faces(const Shape& shape, const Transform& T_world_shape,
                                      double size) {
  const bool box = std::holds_alternative<BoxShape>(shape);
  if (!box && !std::holds_alternative<RectangleShape>(shape)) {
    return body_faces(shape, T_world_shape, size);
  }
  std::vector<OccluderFace> faces;
  for (const auto& quad : flat_faces(shape, T_world_shape, size)) faces.push_back({quad, box});
  return faces;
}

namespace {

using Eigen::Vector3d;

/// Light below this share of the brightest light is rounding error or the part that pulse tables
/// leave out. add() compares within a zone, relative_error() over all zones.
constexpr double kNoLight = 1e-7;
/// Largest edge of a patch relative to its distance to the sensor: by judgement the same as that of
/// two-bounce patches relative to their distance to the facing surfaces (patch_angle).
constexpr double kSensorAngle = 0.4;
/// Cells of the direct return, by judgement of time. Their error is measured
/// (StaticBackgroundModel::error) and carried in the likelihood.
constexpr DirectSampling kDirectCells{4, 0.3, 5};
/// Better cells, against which that error is measured. Inside a surface, the error of two Gauss
/// nodes grows with the fourth power of the cell's edge. Over a border, the better cells are a
/// third as long. The better cells err by at most 0.9 times as much as the usual ones.
constexpr DirectSampling kBetterCells{6, 0.25, 6};
/// Cells for bright captures. Against cells a tenth as large (L2 over photon noise), the usual
/// cells are off by 1.6e-5 (TMF8828 wall), 1e-4 (its floor) and 7e-5 (street), the fine cells by
/// 2e-7, 1e-6 and 4e-6. While a sensor moves over the crossing, the usual cells are off by 6e-5
/// to 3.3e-4.
constexpr DirectSampling kFineCells{12, 0.1, 4}, kBetterThanFine{16, 0.07, 5};
/// Share of the bounces' squared error up to which the direct return keeps its usual cells.
constexpr double kMinorError = 0.1;
/// Number of parts in which the bounces are summed in parallel. It is fixed, so that sums do not
/// depend on the number of threads. By judgement: some for each core.
constexpr std::size_t kParts = 8;
/// Number of patches or cells that share the same parts of a patch tree: by judgement, the number
/// that is checked together for shadows.
constexpr std::size_t kBlock = ShadowView::kChunk;
/// Least relative error of the direct return: the part that the pulse tables leave out.
constexpr double kMinBackgroundError = 1e-6;

/// Finer samplings. On the reference floor, whose own light is 80 times the object's, each has at
/// most a third of the squared error of the one before. Without them the error is 10 % of the light
/// that bounces there (L2 over photon noise); with them it is 2.8, 1.6 and 0.9 %. Patches that
/// touch the surfaces that they face need the small angles. A scene takes the finest sampling that
/// costs at most kCheapLegs, which is up to 4 ms.
constexpr std::array<StaticLightSampling, 3> kFinerSamplings = {{
    {.outer_angle = 0.4, .middle_angle = 0.3},
    {.least_patch = 2, .outer_angle = 0.3, .middle_angle = 0.2},
    {.least_patch = 1.5, .outer_angle = 0.2, .middle_angle = 0.2, .least_middle = 0.005},
}};
constexpr std::size_t kCheapLegs = 400'000;

StaticLightSampling sampling_for(const Scene& scene) {
  StaticLightSampling sampling;
  const SensorPlacement own = sensor_placement(scene);
  if (!own.relay_points.empty()) return sampling;
  const RelaySetup setup(scene, own);
  for (const StaticLightSampling& finer : kFinerSamplings) {
    if (KnownBounces(scene, finer).legs(setup) > kCheapLegs) break;
    sampling = finer;
  }
  return sampling;
}

/// A sampling with edges one and a half times as long, for a third of the time.
StaticLightSampling coarser_than(const StaticLightSampling& sampling) {
  StaticLightSampling coarser = denser(sampling, 1 / 1.5);
  coarser.zone_divisions = sampling.zone_divisions;
  return coarser;
}

/// Densities of the bounces of bright captures. The first that costs at most kBrightLegs is taken,
/// which is up to 20 ms. The wall's error is 1.4e-4 (L2 over photon noise); with a
/// sampling twice as dense it is 2.6e-5.
constexpr std::array kBrightDensities{2.8, 2.0, 1.4};
constexpr std::size_t kBrightLegs = 3'000'000;

/// Most legs of the usual sampling where every frame needs the light anew: up to 20 ms of two
/// processors. On the crossing, with six times as many, the coarser sampling takes half the time.
constexpr std::size_t kTimelyLegs = 500'000;

/// Density of the coarse bounces. They tell whether the light that a hidden object blocks matters.
/// On a desk, the blocked light is off by 40 % (L2) in the coarse bounces and by 3 % in the
/// usual ones.
constexpr double kShadowDensity = 0.5;

/// Error of a sampling as a share of its difference from a coarser one. Errors grow with the square
/// of the edges of patches and cells, and the number of legs falls with their fourth power. If the
/// finer sampling has the error e, the coarser one has e sqrt(`legs`), where `legs` is the ratio of
/// the numbers of legs. Measured against a sampling three times as dense, on seven random scenes
/// and the reference floor, the error is 0.5 to 1.6 times this estimate; where shadows' edges
/// decide, errors fall less. With the power 2/3 of the legs, the middle of these measurements, the
/// covariance of a bright wall becomes too small (stability row photons_1e7: 288 of 30 allowed).
double of_difference(double legs) {
  constexpr double kLeast = 0.3;  // by judgement: hardly any more legs tell nothing
  return 1 / std::max(std::sqrt(legs) - 1, kLeast);
}

/// Share of a cell's area below which a part of it is rounding error.
constexpr double kSliver = 1e-9;

/// Light smoothed over the pulse's width.
HistogramCube smoothed(const Sensor& sensor, const HistogramCube& light) {
  const int reach = static_cast<int>(std::ceil(sensor.response.core_sigma() / sensor.bin_width));
  HistogramCube smooth = light;
  for (int z = 0; z < light.zones(); ++z) {
    const double* row = light.zone(z);
    for (int k = 0; k < light.bins; ++k) {
      const int first = std::max(k - reach, 0), end = std::min(k + reach + 1, light.bins);
      smooth.zone(z)[k] = std::accumulate(row + first, row + end, 0.0) / (end - first);
    }
  }
  return smooth;
}

/// Relative error of `light` against `better`, weighted as photon noise weighs it. Errors are
/// correlated along a zone, as far as their autocorrelation reaches, and across zones. The result
/// is as large as independent errors would have to be to sum up as these do.
double relative_error(const HistogramCube& light, const HistogramCube& better,
                      const HistogramCube& smooth) {
  double size = 0;
  for (const double value : smooth.values) size += std::max(value, 0.0);
  const double peak = *std::ranges::max_element(smooth.values);
  if (!(size > 0)) return 0;
  HistogramCube error = light;  // in units of the photon noise
  for (std::size_t i = 0; i < error.values.size(); ++i) {
    const double s = smooth.values[i];
    error.values[i] = s > kNoLight * peak ? (light.values[i] - better.values[i]) / std::sqrt(s) : 0;
  }
  double square = 0;
  for (const double e : error.values) square += e * e;
  if (!(square > 0)) return 0;
  double run = 1;  // bins
  for (int lag = 1; lag < light.bins; ++lag) {
    double sum = 0;
    for (int z = 0; z < light.zones(); ++z) {
      const double* row = error.zone(z);
      sum += std::inner_product(row, row + light.bins - lag, row + lag, 0.0);
    }
    if (sum <= 0) break;
    run += 2 * sum / square;
  }
  double together = 0;  // zones
  for (int k = 0; k < light.bins; ++k) {
    double sum = 0;
    for (int z = 0; z < light.zones(); ++z) sum += error.zone(z)[k];
    together += sum * sum / square;
  }
  return std::sqrt(square / size * run * std::max(together, 1.0));
}

double total(const HistogramCube& light) {
  return std::accumulate(light.values.begin(), light.values.end(), 0.0);
}

/// Faces that can hide one surface from another. The plane of such a face has parts of the other
/// surfaces on both sides. A room's own walls are no such faces.
std::vector<OccluderFace> blocking_faces(const std::vector<Surface>& surfaces) {
  std::vector<std::vector<OccluderFace>> all;
  for (const Surface& surface : surfaces)
    all.push_back(known_faces(surface.shape, surface.T_world_surface, 1.0));
  std::vector<OccluderFace> blocking;
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (const OccluderFace& face : all[i]) {
      const Vector3d normal = face_normal(face.corners);
      double least = 0, most = 0;
      for (std::size_t j = 0; j < all.size(); ++j) {
        if (j == i) continue;
        for (const OccluderFace& other : all[j]) {
          for (const Vector3d& corner : other.corners) {
            const double side = normal.dot(corner - face.corners[0]);
            least = std::min(least, side);
            most = std::max(most, side);
          }
        }
      }
      if (least < -1e-6 && most > 1e-6) blocking.push_back(face);
    }
  }
  return blocking;
}

/// Halves a cell along its longer edge.
std::array<SurfaceCell, 2> halves(const SurfaceCell& cell) {
  std::array<SurfaceCell, 2> parts{cell, cell};
  const bool along_u = cell.half_u.norm() >= cell.half_v.norm();
  for (std::size_t i = 0; i < 2; ++i) {
    Vector3d& half = along_u ? parts[i].half_u : parts[i].half_v;
    half *= 0.5;
    parts[i].center += (i == 0 ? -1.0 : 1.0) * half;
    parts[i].area *= 0.5;
  }
  return parts;
}

/// Whether a face stands across a cell, on it or within `near` of it. Such a face hides things from
/// one part of the cell that it does not hide from the other part.
bool stands_across(const OccluderFace& face, const SurfaceCell& cell, double near) {
  const Vector3d normal = face_normal(face.corners);
  const double middle = normal.dot(cell.center - face.corners[0]);
  const double reach = std::abs(normal.dot(cell.half_u)) + std::abs(normal.dot(cell.half_v));
  const bool parallel = reach < 1e-6 * (cell.half_u.norm() + cell.half_v.norm());
  if (parallel || std::abs(middle) > (1 - 1e-6) * reach) return false;
  std::vector<Vector3d> foot(face.corners.begin(), face.corners.end());
  for (const double side : {-1.0, 1.0}) {
    foot = clip(foot, cell.center + side * near * cell.normal, -side * cell.normal);
    for (const Vector3d& half : {cell.half_u, cell.half_v}) {
      foot = clip(foot, cell.center + side * half, -side * half);
    }
  }
  return !foot.empty();
}

/// The parallelogram with the area, middle and second moments of a polygon on a cell. The polygon's
/// corners turn from the cell's first half edge to its second.
SurfaceCell like_polygon(const std::vector<Vector3d>& corners, SurfaceCell cell) {
  const Vector3d u = cell.half_u.normalized(), v = cell.half_v.normalized();
  const Vector3d origin = cell.center;
  const auto flat = [&](std::size_t i) {
    const Vector3d way = corners[i] - origin;
    return Eigen::Vector2d(way.dot(u), way.dot(v));
  };
  double area = 0;
  Eigen::Vector2d first = Eigen::Vector2d::Zero();
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero();
  for (std::size_t i = 1; i + 1 < corners.size(); ++i) {  // triangles
    const Eigen::Vector2d a = flat(0), b = flat(i), c = flat(i + 1), sum = a + b + c;
    const double part = 0.5 * ((b - a).x() * (c - a).y() - (b - a).y() * (c - a).x());
    area += part;
    first += part / 3 * sum;
    second += part / 12 *
              (sum * sum.transpose() + a * a.transpose() + b * b.transpose() + c * c.transpose());
  }
  first /= area;
  const Eigen::Matrix2d moments = second / area - first * first.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(moments);
  const auto half = [&](Eigen::Index i) -> Vector3d {
    const Eigen::Vector2d axis =
        std::sqrt(3 * std::max(axes.eigenvalues()[i], 0.0)) * axes.eigenvectors().col(i);
    return axis.x() * u + axis.y() * v;
  };
  cell.center = origin + first.x() * u + first.y() * v;
  cell.half_u = half(1);
  cell.half_v = half(0);
  cell.area = area;
  return cell;
}

/// The parts of a cell between the faces that stand across it; none where no face stands across it.
/// What is hidden from a cell is determined at its centre alone.
std::vector<SurfaceCell> parts_between(const std::vector<OccluderFace>& faces,
                                       const SurfaceCell& cell, double near) {
  const Vector3d &c = cell.center, &u = cell.half_u, &v = cell.half_v;
  std::vector<std::vector<Vector3d>> polygons{{c - u - v, c + u - v, c + u + v, c - u + v}};
  for (const OccluderFace& face : faces) {
    if (!stands_across(face, cell, near)) continue;
    const Vector3d normal = face_normal(face.corners);
    std::vector<std::vector<Vector3d>> parts;
    for (const auto& polygon : polygons) {
      for (const double side : {-1.0, 1.0}) {
        auto part = clip(polygon, face.corners[0], side * normal);
        if (part.size() > 2) parts.push_back(std::move(part));
      }
    }
    polygons = std::move(parts);
  }
  std::vector<SurfaceCell> cells;
  if (polygons.size() == 1) return cells;
  for (const auto& polygon : polygons) {
    SurfaceCell part = like_polygon(polygon, cell);
    if (part.area > kSliver * cell.area) cells.push_back(part);
  }
  return cells;
}

/// Whether each piece has a part on the front side of the other; pieces of one surface do not.
bool facing(const KnownBounces::Piece& a, const KnownBounces::Piece& b) {
  const Vector3d way = b.cell.center - a.cell.center;
  const double reach_a =
      std::abs(b.cell.half_u.dot(a.cell.normal)) + std::abs(b.cell.half_v.dot(a.cell.normal));
  const double reach_b =
      std::abs(a.cell.half_u.dot(b.cell.normal)) + std::abs(a.cell.half_v.dot(b.cell.normal));
  return a.surface != b.surface && way.dot(a.cell.normal) + reach_a > 1e-9 &&
         reach_b - way.dot(b.cell.normal) > 1e-9;
}

/// Distance from a point to a parallelogram with perpendicular edges.
double distance_to(const Vector3d& point, const SurfaceCell& cell) {
  const Vector3d way = point - cell.center;
  const double u = way.dot(cell.half_u) / cell.half_u.squaredNorm();
  const double v = way.dot(cell.half_v) / cell.half_v.squaredNorm();
  return (way - std::clamp(u, -1.0, 1.0) * cell.half_u - std::clamp(v, -1.0, 1.0) * cell.half_v)
      .norm();
}

/// into += scale * (from moved by `at` cells), `at` >= 0; linear between cells.
BLINDCORNER_MULTIVERSION void add_moved(const double* from, std::size_t count, double at,
                                        double scale, double* into) {
  const auto whole = static_cast<std::size_t>(at);
  const double late = scale * (at - static_cast<double>(whole));
  const double early = scale - late;
  double* out = into + whole;
  BLINDCORNER_INDEPENDENT
  for (std::size_t i = 0; i < count; ++i) out[i] += early * from[i] + late * from[i - 1];
}

/// Time axis of cells that are summed once or twice at the end. A spread path takes two or four
/// deposits, however long the spread is.
struct Axis {
  double cells_per_metre;
  std::size_t cells;

  void deposit(double* row, double at, double weight) const {
    if (!(at >= 1) || at >= static_cast<double>(cells) - 2) {
      if (at >= 1) return;
      at = 1;
    }
    const auto i = static_cast<std::size_t>(at);
    const double late = weight * (at - static_cast<double>(i));
    row[i] += weight - late;
    row[i + 1] += late;
  }
  /// Adds a trapezium to a row that is summed twice: light spread evenly over two widths (cells).
  void spread(double* row, double at, double weight, double a, double b) const {
    const double scale = weight / (a * b);
    at += 1;  // each of the two sums puts its steps half a cell early
    const double sum = 0.5 * (a + b), difference = 0.5 * std::abs(a - b);
    deposit(row, at - sum, scale);
    deposit(row, at - difference, -scale);
    deposit(row, at + difference, -scale);
    deposit(row, at + sum, scale);
  }
};

/// The largest of the widths, and the root sum of squares of the others; each at least one cell.
inline std::array<double, 2> two_widths(const std::array<double, 4>& half, double cells_per_metre) {
  const double largest = std::max(std::max(half[0], half[1]), std::max(half[2], half[3]));
  const double square =
      half[0] * half[0] + half[1] * half[1] + half[2] * half[2] + half[3] * half[3];
  return {
      std::max(2 * largest * cells_per_metre, 1.0),
      std::max(2 * std::sqrt(std::max(square - largest * largest, 0.0)) * cells_per_metre, 1.0)};
}

void sum_up(double* row, std::size_t cells) {
  double sum = 0;
  for (std::size_t i = 0; i < cells; ++i) row[i] = sum += row[i];
}

}  // namespace

KnownBounces::KnownBounces(const Scene& scene, const StaticLightSampling& sampling)
    : scene_(scene), sampling_(sampling), blockers_(blocking_faces(scene.surfaces)) {
  // Captures whose times count from the relay hold no returns of the known scene.
  if (scene.sensor.path_origin == PathOrigin::relay) return;
  for (std::size_t i = 0; i < scene.surfaces.size(); ++i) {
    const Surface& surface = scene.surfaces[i];
    if (surface.albedo <= 0) continue;
    largest_ = std::max(largest_, 2 * bounding_radius(surface.shape, Anchor::center));
    for (const SurfaceCell& cell : divide(surface.shape, surface.T_world_surface, 1.0, 1e9)) {
      faces_.push_back({i, cell});
    }
  }
  for (const Piece& face : faces_) {
    if (distance(face, faces_) < std::numeric_limits<double>::infinity()) add_middle(face);
  }
  roots_ = middle_.size();
  // Breadth first, so that the halves of a cell are neighbours; the list grows during the loop.
  std::size_t next = 0;
  while (next < middle_.size()) {
    Middle& cell = middle_[next++];
    const Piece whole = cell.piece;
    if (cell.edge <= allowed_edge(distance(whole, faces_))) continue;
    cell.parts = middle_.size();
    for (const SurfaceCell& half : halves(whole.cell)) add_middle({whole.surface, half});
  }
}

void KnownBounces::add_middle(const Piece& piece) {
  const SurfaceCell& cell = piece.cell;
  const auto element = [&](const SurfaceCell& part) {
    return Element{part, part.area * scene_.surfaces[piece.surface].albedo / kPi,
                   ShadowView(blockers_, part.center)};
  };
  Middle& middle = middle_.emplace_back();
  middle.piece = piece;
  middle.edge = 2 * std::max(cell.half_u.norm(), cell.half_v.norm());
  for (const SurfaceCell& part :
       parts_between(blockers_, cell, sampling_.least_middle * largest_)) {
    middle.elements.push_back(element(part));
  }
  if (middle.elements.empty()) middle.elements.push_back(element(cell));
}

double KnownBounces::allowed_edge(double distance) const {
  return std::max(std::min(sampling_.middle_angle * distance, sampling_.middle_edge * largest_),
                  sampling_.least_middle * largest_);
}

/// Distance from a piece's centre to the nearest face that it faces; infinite if it faces none.
double KnownBounces::distance(const Piece& piece, const std::vector<Piece>& faces) {
  double least = std::numeric_limits<double>::infinity();
  for (const Piece& face : faces) {
    if (facing(piece, face)) {
      least = std::min(least, distance_to(piece.cell.center, face.cell));
    }
  }
  return least;
}

namespace {

/// Rectangles around patches: one rectangle on each face that has patches.
class Extents {
 public:
  explicit Extents(const std::vector<KnownBounces::Piece>& faces)
      : faces_(faces), ranges_(faces.size()) {}

  void add(const RelayPatch& patch) {
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      const SurfaceCell& face = faces_[f].cell;
      if (faces_[f].surface != static_cast<std::size_t>(patch.surface)) continue;
      if (face.normal.dot(patch.normal) < kSameNormal) continue;
      for (const double a : {-1.0, 1.0}) {
        for (const double b : {-1.0, 1.0}) {
          const Vector3d way = patch.center + a * patch.half_u + b * patch.half_v - face.center;
          ranges_[f].add(way.dot(face.half_u) / face.half_u.squaredNorm(),
                         way.dot(face.half_v) / face.half_v.squaredNorm());
        }
      }
    }
  }

  std::vector<KnownBounces::Piece> pieces() const {
    std::vector<KnownBounces::Piece> all;
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      const Ranges& r = ranges_[f];
      if (!(r.low_u < r.high_u && r.low_v < r.high_v)) continue;
      SurfaceCell cell = faces_[f].cell;
      cell.center += 0.5 * (r.low_u + r.high_u) * cell.half_u;
      cell.center += 0.5 * (r.low_v + r.high_v) * cell.half_v;
      cell.half_u *= 0.5 * (r.high_u - r.low_u);
      cell.half_v *= 0.5 * (r.high_v - r.low_v);
      all.push_back({faces_[f].surface, cell});
    }
    return all;
  }

 private:
  /// Mesh facets with nearly the same normal share their patches. Extents that are too large only
  /// make cells finer.
  static constexpr double kSameNormal = 0.8;  // cosine of 37 degrees, by judgement
  /// Ranges in units of the face's half edges.
  struct Ranges {
    double low_u = 1, high_u = -1, low_v = 1, high_v = -1;
    void add(double u, double v) {
      u = std::clamp(u, -1.0, 1.0);
      v = std::clamp(v, -1.0, 1.0);
      low_u = std::min(low_u, u);
      high_u = std::max(high_u, u);
      low_v = std::min(low_v, v);
      high_v = std::max(high_v, v);
    }
  };
  const std::vector<KnownBounces::Piece>& faces_;
  std::vector<Ranges> ranges_;
};

}  // namespace

struct KnownBounces::Ends {
  std::vector<PatchTree> lit;  // one, or one for each zone (confocal)
  std::optional<PatchTree> seen;
  KnownPatches seen_patches;
  std::size_t lit_count = 0;   // patches
  std::vector<Piece> extents;  // for each face the rectangle around all patches on it

  const PatchTree& lit_for(int zone) const {
    return lit[lit.size() == 1 ? 0 : static_cast<std::size_t>(zone)];
  }
};

KnownBounces::Ends KnownBounces::ends_of_two(const RelaySetup& setup) const {
  return ends(setup, sampling_.zone_divisions, sampling_.patch_angle, least_patch());
}

KnownBounces::Ends KnownBounces::ends_of_three(const RelaySetup& setup) const {
  return ends(setup, sampling_.outer_divisions, sampling_.outer_angle, 2 * least_patch());
}

KnownBounces::Ends KnownBounces::ends(const RelaySetup& setup, int zone_divisions, double angle,
                                      double least) const {
  const Sensor& sensor = scene_.sensor;
  const bool confocal = sensor.illumination == Illumination::confocal;
  RelaySampling relay;
  relay.edge_depth = 2;
  relay.with_radiance = false;
  relay.split = [this, angle, least](const RelayPatch& patch) {
    const double u = 2 * patch.half_u.norm(), v = 2 * patch.half_v.norm();
    const double near = distance({static_cast<std::size_t>(patch.surface), cell_of(patch)}, faces_);
    const double most = std::min(kSensorAngle * patch.distance, std::max(angle * near, least));
    return std::max(u, v) <= most ? 0 : (u >= v ? 1 : 2);
  };
  Ends ends;
  std::vector<KnownPatches> lit(confocal ? sensor.zones.size() : 1);
  Extents extents(faces_);
  const auto add = [&](const std::vector<WeightedPatch>& patches, int zone, KnownPatches& to) {
    for (const WeightedPatch& p : patches) {
      if (p.weight <= 0) continue;
      to.add(p, zone);
      extents.add(p.patch);
    }
  };
  relay.divisions = sampling_.field_divisions;
  if (!confocal) add(setup.lit(relay, false), 0, lit[0]);
  relay.divisions = zone_divisions;
  for (int z = 0; z < sensor.zone_count(); ++z) {
    if (sensor.zones[static_cast<std::size_t>(z)].dead) continue;
    add(setup.seen(z, relay, false), z, ends.seen_patches);
    if (confocal) {
      add(setup.lit_by_zone(z, relay, false), z, lit[static_cast<std::size_t>(z)]);
    }
  }
  for (const KnownPatches& patches : lit) {
    ends.lit.emplace_back(patches, sampling_.part_angle, kSensorAngle);
    ends.lit_count += patches.size();
  }
  ends.seen.emplace(ends.seen_patches, sampling_.part_angle, kSensorAngle);
  ends.extents = extents.pieces();
  return ends;
}

std::vector<const KnownBounces::Element*> KnownBounces::middle_for(const Ends& ends) const {
  std::vector<const Element*> chosen;
  const auto visit = [&](const auto& self, const Middle& cell) -> void {
    const double near = distance(cell.piece, ends.extents);
    if (near == std::numeric_limits<double>::infinity()) return;
    if (cell.parts == 0 || cell.edge <= allowed_edge(near)) {
      for (const Element& element : cell.elements) chosen.push_back(&element);
      return;
    }
    self(self, middle_[cell.parts]);
    self(self, middle_[cell.parts + 1]);
  };
  for (std::size_t i = 0; i < roots_; ++i) visit(visit, middle_[i]);
  return chosen;
}

/// Light of all zones by path, in rows that are summed once or twice.
struct KnownBounces::TimeRows {
  /// Cells per bin, by judgement: light that bounces on is smooth over several bins.
  static constexpr int kPerBin = 2;
  /// Cells before path zero and after the end of the axis. Pulse ends that lie half a cell early
  /// need them; by judgement there are some more.
  static constexpr std::size_t kMargin = 8;

  Axis axis;
  std::size_t stride;
  std::vector<double> once, twice;

  explicit TimeRows(const Sensor& sensor)
      : axis{kPerBin / (kSpeedOfLight * sensor.bin_width),
             static_cast<std::size_t>(kPerBin * unwrapped_bins(sensor)) + kMargin},
        stride(2 * axis.cells + 2 * kMargin),
        once(sensor.zones.size() * stride, 0.0),
        twice(once) {}

  /// A zone's row, from the cell of path length zero.
  double* once_of(int zone) { return once.data() + zone * static_cast<long>(stride) + kMargin; }
  double* twice_of(int zone) { return twice.data() + zone * static_cast<long>(stride) + kMargin; }
};

/// Paths from the source over lit patch p and seen patch r to the detector.
void KnownBounces::add_two(const Ends& ends, const std::vector<std::vector<std::size_t>>& blocks,
                           const std::vector<OccluderFace>& blockers, std::size_t part,
                           TimeRows& rows) const {
  const KnownPatches& seen = ends.seen_patches;
  KnownPatches from;
  KnownLegs in;
  std::vector<const SurfaceCell*> cells;
  for (std::size_t b = part; b < blocks.size(); b += kParts) {
    cells.clear();
    for (const std::size_t r : blocks[b]) cells.push_back(&seen.cells[r]);
    ends.lit_for(seen.zone[blocks[b].front()]).cut(ball_around(cells), from);
    for (const std::size_t r : blocks[b]) {
      const SurfaceCell& cell = seen.cells[r];
      in.find(cell, ShadowView(blockers, cell.center), from);
      const Vector3d outer = seen.gradient(r);
      for (std::size_t p = 0; p < from.size(); ++p) {
        if (in.weight[p] <= 0) continue;
        const Vector3d gradient = outer - Vector3d(in.x[p], in.y[p], in.z[p]);
        const auto [a, b2] = two_widths({in.du[p], in.dv[p], std::abs(gradient.dot(cell.half_u)),
                                         std::abs(gradient.dot(cell.half_v))},
                                        rows.axis.cells_per_metre);
        rows.axis.spread(rows.twice_of(seen.zone[r]),
                         (in.length[p] + seen.leg[r]) * rows.axis.cells_per_metre,
                         in.weight[p] * seen.weight[r], a, b2);
      }
    }
  }
}

namespace {

/// Light that a cell gathers, by path.
struct Gathered {
  std::vector<double> row;
  std::size_t first = 0, last = 0;  // lit cells of the row
  Vector3d arrives;                 // mean direction to the patches that the light came from

  void gather(const KnownLegs& in, const Axis& axis, double margin) {
    double early = std::numeric_limits<double>::infinity(), late = 0, all = 0;
    std::fill(row.begin(), row.end(), 0.0);
    arrives.setZero();
    for (std::size_t p = 0; p < in.weight.size(); ++p) {
      if (in.weight[p] <= 0) continue;
      const double at = in.length[p] * axis.cells_per_metre + margin;
      const auto [a, b] = two_widths({in.du[p], in.dv[p], 0, 0}, axis.cells_per_metre);
      axis.spread(row.data(), at, in.weight[p], a, b);
      early = std::min(early, at - 0.5 * (a + b));
      late = std::max(late, at + 0.5 * (a + b));
      all += in.weight[p];
      arrives += in.weight[p] * Vector3d(in.x[p], in.y[p], in.z[p]);
    }
    first = last = 0;
    if (!(all > 0)) return;
    arrives /= all;
    first = static_cast<std::size_t>(std::max(early, 1.0));
    last = std::max(first, std::min(static_cast<std::size_t>(late) + 3, axis.cells));
    sum_up(row.data() + first, last - first);
    sum_up(row.data() + first, last - first);
  }
};

}  // namespace

/// Paths from the source over lit patch p, a middle cell and seen patch r to the detector.
void KnownBounces::add_three(const Ends& ends, const std::vector<const Element*>& all_middle,
                             const std::vector<OccluderFace>& bodies, std::size_t part,
                             TimeRows& rows) const {
  std::vector<OccluderFace> blockers = blockers_;
  blockers.insert(blockers.end(), bodies.begin(), bodies.end());
  const Axis& axis = rows.axis;
  const bool confocal = ends.lit.size() > 1;
  constexpr double kMargin = TimeRows::kMargin;
  KnownPatches seen;
  std::vector<KnownPatches> lit(ends.lit.size());  // by zone (confocal)
  std::vector<const SurfaceCell*> cells;
  KnownLegs in, out;
  Gathered light{std::vector<double>(rows.stride), 0, 0, Vector3d::Zero()};
  const auto add_cell = [&](const Element& middle) {
    const SurfaceCell& cell = middle.cell;
    const ShadowView shadows = bodies.empty() ? middle.shadows : ShadowView(blockers, cell.center);
    out.find(cell, shadows, seen);
    int gathered = -1;  // zone
    // Patches of a zone whose paths adjoin are merged into one that is as wide as all of them.
    struct Run {
      int zone = -1;
      double weight = 0, length = 0, square = 0, half2 = 0;  // sums over patches, weighted
    };
    Run run;
    const auto flush = [&] {
      if (run.weight <= 0) return;
      const double length = run.length / run.weight;
      const double half2 =
          std::max(run.square / run.weight - length * length, 0.0) * 3 + run.half2 / run.weight;
      const double width = std::max(2 * axis.cells_per_metre * std::sqrt(half2), 1.0);
      // The light is delayed by the way out and spread evenly. Only both ends of the spread are
      // added, because the row is summed at the end; as in Axis::spread(), the sum puts them half a
      // cell early.
      const double at =
          length * axis.cells_per_metre + 0.5 + static_cast<double>(light.first) - kMargin;
      const double weight = middle.scattered * run.weight / width;
      for (const double end : {-0.5, 0.5}) {
        const double from = std::max(at + end * width, 0.0);
        if (from >= static_cast<double>(axis.cells)) continue;
        add_moved(light.row.data() + light.first, light.last - light.first + 1, from,
                  end < 0 ? weight : -weight, rows.once_of(run.zone));
      }
      run.weight = 0;
    };
    for (std::size_t r = 0; r < seen.size(); ++r) {
      if (out.weight[r] <= 0) continue;
      if (gathered < 0 || (confocal && seen.zone[r] != gathered)) {
        flush();
        gathered = seen.zone[r];
        in.find(cell, shadows, lit[confocal ? static_cast<std::size_t>(gathered) : 0]);
        light.gather(in, axis, kMargin);
      }
      if (light.first == light.last) continue;
      const Vector3d gradient = light.arrives + Vector3d(out.x[r], out.y[r], out.z[r]);
      const double u = gradient.dot(cell.half_u), v = gradient.dot(cell.half_v);
      const double half2 = u * u + v * v + out.du[r] * out.du[r] + out.dv[r] * out.dv[r];
      if (run.weight > 0) {
        const double gap = out.length[r] - run.length / run.weight;
        if (seen.zone[r] != run.zone || gap * gap > 4 * std::max(half2, run.half2 / run.weight)) {
          flush();
        }
      }
      if (run.weight <= 0) run = {seen.zone[r], 0, 0, 0, 0};
      const double w = out.weight[r];
      run.weight += w;
      run.length += w * out.length[r];
      run.square += w * out.length[r] * out.length[r];
      run.half2 += w * half2;
    }
    flush();
  };
  for (std::size_t first = part * kBlock; first < all_middle.size(); first += kParts * kBlock) {
    const std::size_t last = std::min(first + kBlock, all_middle.size());
    cells.clear();
    for (std::size_t m = first; m < last; ++m) cells.push_back(&all_middle[m]->cell);
    const Ball ball = ball_around(cells);
    ends.seen->cut(ball, seen);
    for (std::size_t z = 0; z < lit.size(); ++z) ends.lit[z].cut(ball, lit[z]);
    for (std::size_t m = first; m < last; ++m) add_cell(*all_middle[m]);
  }
}

std::size_t KnownBounces::legs(const RelaySetup& setup) const {
  if (!any() || setup.uses_points()) return 0;
  const Ends far = ends_of_three(setup);
  return middle_for(far).size() * (far.seen_patches.size() + far.lit_count);
}

double KnownBounces::least_patch() const {
  const Sensor& sensor = scene_.sensor;
  return sampling_.least_patch * kSpeedOfLight *
         std::hypot(sensor.response.core_sigma(), sensor.bin_width / std::sqrt(12.0));
}

void KnownBounces::add(const RelaySetup& setup, const PulseTable& pulses, HistogramCube& cube,
                       const std::vector<OccluderFace>& bodies) const {
  if (!any() || setup.uses_points()) return;
  const Sensor& sensor = scene_.sensor;
  std::vector<OccluderFace> blockers = blockers_;
  blockers.insert(blockers.end(), bodies.begin(), bodies.end());
  std::vector<TimeRows> parts(kParts, TimeRows(sensor));
  Ends near, far;
  parallel_invoke([&] { near = ends_of_two(setup); }, [&] { far = ends_of_three(setup); });
  const std::vector<const Element*> middle = middle_for(far);
  const std::vector<std::vector<std::size_t>> blocks = near.seen->blocks(kBlock);
  parallel_for(std::size_t{0}, kParts, [&](std::size_t part) {
    add_two(near, blocks, blockers, part, parts[part]);
    add_three(far, middle, bodies, part, parts[part]);
  });
  TimeRows& rows = parts.front();
  for (std::size_t part = 1; part < kParts; ++part) {
    for (std::size_t i = 0; i < rows.once.size(); ++i) {
      rows.once[i] += parts[part].once[i];
      rows.twice[i] += parts[part].twice[i];
    }
  }

  const int bins = unwrapped_bins(sensor);
  std::vector<double> unwrapped(static_cast<std::size_t>(bins));
  for (int z = 0; z < sensor.zone_count(); ++z) {
    double* light = rows.once_of(z);
    const double* pairs = rows.twice_of(z);
    sum_up(rows.twice_of(z), rows.axis.cells);
    for (std::size_t i = 0; i < rows.axis.cells; ++i) light[i] += pairs[i];
    sum_up(light, rows.axis.cells);
    std::fill(unwrapped.begin(), unwrapped.end(), 0.0);
    const double top = *std::max_element(light, light + rows.axis.cells);
    const double start = sensor.zones[static_cast<std::size_t>(z)].time_zero / sensor.bin_width;
    for (std::size_t i = 0; i < rows.axis.cells; ++i) {
      if (light[i] <= kNoLight * top) continue;
      pulses.add(unwrapped.data(), bins, start + static_cast<double>(i) / TimeRows::kPerBin, 0.0,
                 light[i]);
    }
    fold(sensor, z, unwrapped.data(), bins, cube.zone(z));
  }
}

std::vector<OccluderFace> hidden_faces(const Scene& scene, const PoseVector& pose) {
  std::vector<OccluderFace> faces;
  const std::vector<Placement> placements = placements_at(scene, pose);
  for (int i = 0; i < object_count(scene); ++i) {
    const HiddenObject& object = hidden_object(scene, i);
    const Placement& placement = placements[static_cast<std::size_t>(i)];
    const Transform T_world_object = object_to_world(object.shape, object.anchor, placement);
    std::ranges::copy(known_faces(object.shape, T_world_object, placement.size),
                      std::back_inserter(faces));
  }
  return faces;
}

StaticBackgroundModel::StaticBackgroundModel(const Scene& scene)
    : scene_(scene),
      sampling_(sampling_for(scene)),
      bounces_(scene, sampling_),
      pulses_(scene.sensor.response, scene.sensor.bin_width,
              std::pow(scene.sensor.response.core_sigma(), 2), 1e-7) {}

StaticLightSampling denser(StaticLightSampling sampling, double by) {
  const auto times = [by](int n) { return std::max(1, static_cast<int>(std::lround(by * n))); };
  sampling.zone_divisions = times(sampling.zone_divisions);
  sampling.outer_divisions = times(sampling.outer_divisions);
  sampling.field_divisions = times(sampling.field_divisions);
  for (double* edge :
       {&sampling.patch_angle, &sampling.least_patch, &sampling.outer_angle, &sampling.part_angle,
        &sampling.middle_angle, &sampling.middle_edge, &sampling.least_middle}) {
    *edge /= by;
  }
  return sampling;
}

const KnownBounces* StaticBackgroundModel::finer_bounces() const {
  std::call_once(finer_once_, [this] {
    const SensorPlacement own = sensor_placement(scene_);
    if (!bounces_.any() || !own.relay_points.empty()) return;
    const RelaySetup setup(scene_, own);
    for (const double density : kBrightDensities) {
      // Patches and cells become `density` times as many along either edge, so that legs become at
      // least density^2 times as many.
      if (static_cast<double>(bounces_.legs(setup)) * std::pow(density, 2) > kBrightLegs) continue;
      auto finer = std::make_unique<KnownBounces>(scene_, denser(sampling_, density));
      if (finer->legs(setup) > kBrightLegs) continue;
      finer_ = std::move(finer);
      return;
    }
  });
  return finer_.get();
}

const KnownBounces& StaticBackgroundModel::coarser_bounces() const {
  std::call_once(coarser_once_, [this] {
    coarser_ = std::make_unique<KnownBounces>(scene_, coarser_than(sampling_));
  });
  return *coarser_;
}

bool StaticBackgroundModel::any_coarser() const {
  std::call_once(timely_once_, [this] {
    const SensorPlacement own = sensor_placement(scene_);
    if (!bounces_.any() || !own.relay_points.empty()) return;
    coarser_is_timely_ = bounces_.legs(RelaySetup(scene_, own)) > kTimelyLegs;
  });
  return coarser_is_timely_;
}

KnownLightSampling StaticBackgroundModel::bounces_sampling(Sampling wanted) const {
  if (wanted == Sampling::fine && finer_bounces() == nullptr) return Sampling::usual;
  if (wanted == Sampling::timely && !any_coarser()) return Sampling::usual;
  return wanted;
}

const KnownBounces& StaticBackgroundModel::bounces_of(Sampling wanted) const {
  switch (bounces_sampling(wanted)) {
    case Sampling::fine:
      return *finer_bounces();
    case Sampling::timely:
      return coarser_bounces();
    case Sampling::usual:
      break;
  }
  return bounces_;
}

bool StaticBackgroundModel::any_finer() const {
  return fine_direct(Sampling::fine) || (bounces_.any() && finer_bounces() != nullptr);
}

HistogramCube StaticBackgroundModel::light(const RelaySetup& setup, Sampling sampling, bool bounces,
                                           HistogramCube& direct) const {
  HistogramCube known =
      setup.direct_return(pulses_, fine_direct(sampling) ? kFineCells : kDirectCells);
  direct = known;
  mix_zones(scene_.sensor, direct);
  if (bounces && bounces_.any()) bounces_of(sampling).add(setup, pulses_, known);
  mix_zones(scene_.sensor, known);
  return known;
}

const KnownBounces& StaticBackgroundModel::shadow_bounces() const {
  std::call_once(shadow_once_, [this] {
    shadow_ = std::make_unique<KnownBounces>(scene_, denser(sampling_, kShadowDensity));
  });
  return *shadow_;
}

HistogramCube StaticBackgroundModel::bounces_behind(const RelaySetup& setup,
                                                    const std::vector<OccluderFace>& bodies,
                                                    bool coarsely) const {
  const Sensor& sensor = scene_.sensor;
  HistogramCube light(sensor.rows, sensor.columns, sensor.bins);
  (coarsely ? shadow_bounces() : bounces_).add(setup, pulses_, light, bodies);
  mix_zones(sensor, light);
  return light;
}

StaticBackgroundModel::Own StaticBackgroundModel::measured_direct(bool fine) const {
  const SensorPlacement own = sensor_placement(scene_);
  if (!own.relay_points.empty()) return {};  // relay points come with captures
  const RelaySetup setup(scene_, own);
  const HistogramCube light = setup.direct_return(pulses_, fine ? kFineCells : kDirectCells);
  const HistogramCube better = setup.direct_return(pulses_, fine ? kBetterThanFine : kBetterCells);
  return {total(light), relative_error(light, better, smoothed(scene_.sensor, light))};
}

StaticBackgroundModel::Own StaticBackgroundModel::measured_bounces(Sampling sampling) const {
  const SensorPlacement own = sensor_placement(scene_);
  if (!bounces_.any() || !own.relay_points.empty()) return {};
  const RelaySetup setup(scene_, own);
  const Sensor& sensor = scene_.sensor;
  HistogramCube light(sensor.rows, sensor.columns, sensor.bins), other = light;
  const KnownBounces& bounces = bounces_of(sampling);
  const KnownBounces& beside = &bounces == &bounces_ ? coarser_bounces() : bounces_;
  const std::size_t legs = bounces.legs(setup), legs_beside = beside.legs(setup);
  if (legs == 0 || legs_beside == 0) return {};  // the sensor sees no surfaces that face each other
  bounces.add(setup, pulses_, light);
  beside.add(setup, pulses_, other);
  const double times = static_cast<double>(legs) / static_cast<double>(legs_beside);
  const double difference = relative_error(light, other, smoothed(sensor, light));
  // The coarser of both samplings has sqrt(legs) times the error of the finer one.
  return {total(light), times > 1 ? of_difference(times) * difference
                                  : of_difference(1 / times) * difference / std::sqrt(times)};
}

const StaticBackgroundModel::Own& StaticBackgroundModel::own_direct(bool fine) const {
  Own& own = own_direct_[fine ? 1 : 0];
  std::call_once(direct_once_[fine ? 1 : 0], [&] { own = measured_direct(fine); });
  return own;
}

const StaticBackgroundModel::Own& StaticBackgroundModel::own_bounces(Sampling sampling) const {
  const auto used = static_cast<std::size_t>(bounces_sampling(sampling));
  std::call_once(bounces_once_[used], [&] { own_bounces_[used] = measured_bounces(sampling); });
  return own_bounces_[used];
}

bool StaticBackgroundModel::fine_direct(Sampling sampling) const {
  if (sampling != Sampling::fine) return false;
  return !bounces_.any() ||
         own_direct(false).error() > kMinorError * own_bounces(Sampling::fine).error();
}

BackgroundError StaticBackgroundModel::error(const HistogramCube& light,
                                             const HistogramCube& direct, Sampling sampling) const {
  HistogramCube bounced = light;
  for (std::size_t i = 0; i < direct.values.size(); ++i) {
    bounced.values[i] = std::max(light.values[i] - direct.values[i], 0.0);
  }
  BackgroundError error{smoothed(scene_.sensor, direct), smoothed(scene_.sensor, bounced)};
  const double of_direct = kMinBackgroundError + own_direct(fine_direct(sampling)).share;
  for (double& value : error.direct.values) value *= of_direct;
  for (double& value : error.bounces.values) value *= own_bounces(sampling).share;
  return error;
}

HistogramCube total(const BackgroundError& error) {
  HistogramCube sum = error.direct;
  for (std::size_t i = 0; i < sum.values.size(); ++i) {
    sum.values[i] = std::hypot(sum.values[i], error.bounces.values[i]);
  }
  return sum;
}

}  // namespace blindcorner
