// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/sampling.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "blindcorner/forward/constants.h"
#include "forward/support/multiversion.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Gaussian closure: a pulse leaves out a group's higher cumulants, with a relative L2 error of
/// 0.05 s^2 for a path spread of s pulse variances.
constexpr double kClosureError = 0.05;
/// With two Gauss nodes along an edge e at distance r, weights like cos^4 / r^4 have a relative
/// error of about 0.01 (e / r)^4.
constexpr double kQuadratureError = 0.01;
/// With the centre alone, the relative error is about 0.35 (e / r)^2.
constexpr double kMidpointError = 0.35;
/// Gauss-Legendre points have the error exp(-2 (n s / a)^2) = e if they are a distance
/// d = kRuleSpread s / sqrt(ln(1 / e)) apart in path (standard deviation of even light between
/// them).
constexpr double kRuleSpread = 0.75;
/// The same for inverse squares and points of the object: the angle between the points is this
/// value over ln(1 / e). By judgement: the search for a sampling scales the object's sampling, so
/// only the ratio of angles to paths matters.
constexpr double kObjectRuleAngle = 1.8;
/// Additional points for each factor of e in the error, because the rules' exponential law asks for
/// too few when points are few.
constexpr double kFewPoints = 0.13;
/// Most points along an edge of a relay cell. Cells that need more are halved, so that dim ones can
/// do with fewer points. For the oblique floor, a limit of 4 reaches an error of 0.2 % (L2) with a
/// quarter fewer points than a limit of 8.
constexpr double kMaxRulePoints = 4;
/// Times that a cell across a border is quartered. The rest of it is shared between the surfaces.
/// More quarterings change no shipped scene's error by 1e-4 of the light.
constexpr int kEdgeDepth = 2;
/// Edge of a tile whose cells share the lobes of its middle, in units of the edge for which a
/// midpoint is enough: lobes matter only at the edges of the light.
constexpr double kAnchorEdge = 2;
/// Least cosine between the normals of cells on one side of the object, 26 degrees. By judgement:
/// the sides of boxes are 90 degrees apart.
constexpr double kSameSide = 0.9;
/// Sine of the elevation above which an edge counts as upright: half way between level and
/// vertical.
constexpr double kUpright = 0.7;
/// Number of cells along an object's extent that show how paths change over the object, by
/// judgement.
constexpr double kEvenCells = 6;
/// Doubles in the widest vector register (512 bits).
constexpr std::size_t kLanes = 8;

/// The object's middle at each probed placement, in lanes that are summed side by side.
class ProbedMiddles {
 public:
  explicit ProbedMiddles(const std::vector<Transform>& T_world_probes)
      : count_(static_cast<double>(T_world_probes.size())) {
    for (const Transform& T : T_world_probes) {
      const Vector3d q = T.translation();
      x_.push_back(q.x());
      y_.push_back(q.y());
      z_.push_back(q.z());
      counts_.push_back(1);
    }
    while (counts_.size() % kLanes != 0) {
      for (auto* v : {&x_, &y_, &z_}) v->push_back(v->back());
      counts_.push_back(0);
    }
  }

  /// Sum over the middles of the cosine at the patch over the distance squared.
  double exchange(const RelayPatch& patch) const;
  /// Means over the middles of the squared changes (direction to the middle + `out`) . half edge
  /// along both edges, and mean of one over the distance squared.
  std::array<double, 3> changes(const RelayPatch& patch, const Vector3d& out) const;
  /// Half the ranges, along both edges, of the path from `origin` through the cell to the middle,
  /// and half edges over the distance. All are root mean squares over places and probes.
  struct Ranges {
    double path_u = 0, path_v = 0, angle_u = 0, angle_v = 0;
  };
  Ranges ranges(const CellPlaces& places, const Vector3d& origin) const;
  double nearest(const Vector3d& p) const {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < x_.size(); ++i) {
      least = std::min(least, (p - Vector3d(x_[i], y_[i], z_[i])).squaredNorm());
    }
    return std::sqrt(least);
  }

 private:
  using Lanes = std::array<double, kLanes>;
  static double total(const Lanes& lanes) {
    double sum = 0;
    for (const double lane : lanes) sum += lane;
    return sum;
  }

  double count_;
  std::vector<double> x_, y_, z_, counts_;  ///< counts are 0 where the lanes are padded
};

BLINDCORNER_MULTIVERSION double ProbedMiddles::exchange(const RelayPatch& patch) const {
  const double px = patch.center.x(), py = patch.center.y(), pz = patch.center.z();
  const double nx = patch.normal.x(), ny = patch.normal.y(), nz = patch.normal.z();
  alignas(64) Lanes sum{};
  for (std::size_t i = 0; i < x_.size(); i += kLanes) {
    for (std::size_t k = 0; k < kLanes; ++k) {
      const double x = x_[i + k] - px, y = y_[i + k] - py, z = z_[i + k] - pz;
      const double r2 = x * x + y * y + z * z;
      sum[k] += counts_[i + k] * std::max(x * nx + y * ny + z * nz, 0.0) / (r2 * std::sqrt(r2));
    }
  }
  return total(sum);
}

BLINDCORNER_MULTIVERSION std::array<double, 3> ProbedMiddles::changes(const RelayPatch& patch,
                                                                      const Vector3d& out) const {
  const double px = patch.center.x(), py = patch.center.y(), pz = patch.center.z();
  const double ux = patch.half_u.x(), uy = patch.half_u.y(), uz = patch.half_u.z();
  const double vx = patch.half_v.x(), vy = patch.half_v.y(), vz = patch.half_v.z();
  const double out_u = out.dot(patch.half_u), out_v = out.dot(patch.half_v);
  alignas(64) Lanes along_u{}, along_v{}, near{};
  for (std::size_t i = 0; i < x_.size(); i += kLanes) {
    for (std::size_t k = 0; k < kLanes; ++k) {
      const double x = px - x_[i + k], y = py - y_[i + k], z = pz - z_[i + k];
      const double inverse2 = 1 / (x * x + y * y + z * z);
      const double inverse = std::sqrt(inverse2);
      const double u = (x * ux + y * uy + z * uz) * inverse + out_u;
      const double v = (x * vx + y * vy + z * vz) * inverse + out_v;
      along_u[k] += counts_[i + k] * u * u;
      along_v[k] += counts_[i + k] * v * v;
      near[k] += counts_[i + k] * inverse2;
    }
  }
  return {total(along_u) / count_, total(along_v) / count_, total(near) / count_};
}

ProbedMiddles::Ranges ProbedMiddles::ranges(const CellPlaces& places,
                                            const Vector3d& origin) const {
  Ranges mean;
  std::array<std::array<double, 3>, 3> path{};
  for (std::size_t k = 0; k < x_.size(); ++k) {
    if (counts_[k] <= 0) continue;
    const Vector3d q(x_[k], y_[k], z_[k]);
    double nearest2 = std::numeric_limits<double>::infinity();
    for (std::size_t j = 0; j < 3; ++j) {
      for (std::size_t i = 0; i < 3; ++i) {
        const double r = (places[j][i] - q).norm();
        path[j][i] = (places[j][i] - origin).norm() + r;
        nearest2 = std::min(nearest2, r * r);
      }
    }
    for (std::size_t j = 0; j < 3; ++j) {
      for (const std::size_t i : {0U, 2U}) {
        mean.path_u += std::pow(path[j][i] - path[j][1], 2);
        mean.path_v += std::pow(path[i][j] - path[1][j], 2);
        mean.angle_u += (places[j][i] - places[j][1]).squaredNorm() / nearest2;
        mean.angle_v += (places[i][j] - places[1][j]).squaredNorm() / nearest2;
      }
    }
  }
  for (double* sum : {&mean.path_u, &mean.path_v, &mean.angle_u, &mean.angle_v}) {
    *sum = std::sqrt(*sum / (6 * count_));
  }
  return mean;
}

/// Brightness of the relay's parts over the probed placements. Dim parts may be sampled more
/// coarsely, and parts whose light adds up to next to nothing are left out.
class Brightness {
 public:
  Brightness(const ProbedMiddles& objects, bool twice, const std::vector<RelayPatch>& coarse)
      : objects_(objects), twice_(twice) {
    for (const RelayPatch& patch : coarse) {
      const double bright = density(patch);
      cells_.push_back({bright, bright * patch.solid_angle});
    }
    std::sort(cells_.begin(), cells_.end());
    for (auto& [bright, light] : cells_) light = total_ += light;
    total_ = std::max(total_, 1e-300);
    for (auto& [bright, light] : cells_) light /= total_;
  }

  /// Light exchanged per solid angle of the patch, up to a constant.
  double density(const RelayPatch& patch) const {
    return patch.albedo * objects_.exchange(patch) /
           (twice_ ? patch.distance * patch.distance : 1.0);
  }
  /// Share of all light that the patch exchanges.
  double share(const RelayPatch& patch) const {
    return density(patch) * patch.solid_angle / total_;
  }
  /// Share of all light that comes from parts no brighter than this.
  double share_below(double bright) const {
    const auto it = std::upper_bound(cells_.begin(), cells_.end(), std::pair(bright, 2.0));
    return it == cells_.begin() ? 0.0 : std::prev(it)->second;
  }

 private:
  const ProbedMiddles& objects_;
  bool twice_;
  std::vector<std::pair<double, double>> cells_;  // density, cumulative share
  double total_ = 0;
};

/// Sampling limits: `coarseness` times those that the closed-form estimates give for the tolerance.
struct Limits {
  double coarseness;
  double pulse_sigma;   ///< m of path
  double spread;        ///< m, path spread that one Gaussian may stand for
  double aspect;        ///< edge over distance of a cell with Gauss nodes
  double midpoint;      ///< edge over distance of a cell for which the centre alone is enough
  double rule_spread;   ///< m, standard deviation of the path between two points of a rule
  double rule_share;    ///< of all light; a relay cell with no more needs next to no points
  double object_angle;  ///< rad, between two points of the object
  double lobe = std::numeric_limits<double>::infinity();  ///< rad, narrowest of a BRDF

  Limits(const SamplingNeeds& needs, double coarse, const HiddenObject& object)
      : coarseness(coarse), pulse_sigma(needs.pulse_sigma) {
    // Six axes share each limit: two each of the lit relay, the seen relay and the object.
    constexpr double kAxes = 6;
    const double tolerance = needs.tolerance;
    spread = coarseness * needs.pulse_sigma * std::pow(tolerance / kClosureError, 0.25) /
             std::sqrt(kAxes);
    aspect = coarseness * std::pow(tolerance / kQuadratureError / kAxes, 0.25);
    midpoint = coarseness * std::sqrt(tolerance / kMidpointError);
    const double digits = std::log(1 / tolerance);
    rule_spread = coarseness * kRuleSpread * needs.pulse_sigma / std::sqrt(digits);
    rule_share = tolerance * std::pow(coarseness, 3);
    object_angle = coarseness * kObjectRuleAngle / digits;
    if (const auto* material = std::get_if<BrdfMaterial>(&object.material)) {
      // From a point to the next, the mirrored way turns by twice the angle.
      lobe = material->brdf->narrowest_lobe();
      object_angle = std::min(object_angle, coarseness * lobe / std::sqrt(digits / 2));
    }
    if (needs.kernel == Kernel::retro_pairs) {
      // A patch stands for a Gaussian within the lobe, so it must be narrow against the lobe.
      const double sigma = std::get<RetroreflectiveMaterial>(object.material).lobe_sigma;
      aspect = std::min(aspect, coarseness * kLobePatch * sigma);
    }
  }
};

using PatchSets = std::vector<std::vector<WeightedPatch>>;

/// Divides the lit and seen relay until cells meet both limits in the root mean square over the
/// probed placements. This bounds the typical pose, not a pose that touches the relay. If only a
/// share C of the light comes from parts no brighter than a cell, the cell may be (0.5 / C)^0.15
/// coarser: its closure error grows with the fourth power, and the sum of share times error stays
/// within a factor of two. Where rules of points are used, rule_points() gives the number of points
/// along each edge.
class RelaySampler {
 public:
  RelaySampler(const SensorView& view, const SamplingNeeds& needs)
      : view_(view),
        limits_(needs, needs.sampling_step.relay, view.transport->scene.hidden),
        objects_(view.transport->T_world_probes),
        single_(needs.kernel == Kernel::retro_single),
        rules_(by_rules(needs.kernel)),
        pairs_(needs.kernel == Kernel::retro_pairs),
        negligible_(needs.keep_dim_patches ? 0.0 : kNegligible * needs.tolerance) {}

  void sample(Sampling& into) {
    const int zones = view_.transport->scene.sensor.zone_count();
    PatchSets lit, seen(static_cast<std::size_t>(zones));
    const Brightness seen_light(objects_, single_, view_.seen);
    const RelaySampling by_zone = sampling(seen_light);
    if (view_.confocal && !single_) lit.resize(seen.size());
    for (int z = 0; z < zones; ++z) {
      const auto i = static_cast<std::size_t>(z);
      if (view_.dead(z)) continue;
      seen[i] = prune(view_.setup.seen(z, by_zone), seen_light, into);
      if (!lit.empty()) lit[i] = view_.setup.lit_by_zone(z, by_zone);
    }
    if (!view_.confocal && !single_) {
      const Brightness lit_light(objects_, false, view_.lit);
      lit.push_back(prune(view_.setup.lit(sampling(lit_light)), lit_light, into));
    }
    const auto fill = [](PatchArrays& arrays, const PatchSets& sets, bool with_zone) {
      for (std::size_t i = 0; i < sets.size(); ++i) {
        arrays.append(sets[i], with_zone ? static_cast<int>(i) : -1);
      }
    };
    fill(into.lit, lit, view_.confocal);
    fill(into.seen, seen, true);
    if (rules_) {
      fill(into.relay, lit, view_.confocal);
      fill(into.relay, seen, true);
    }
    for (PatchArrays* arrays : {&into.lit, &into.seen, &into.relay}) arrays->finish();
  }

 private:
  RelaySampling sampling(const Brightness& brightness) const {
    RelaySampling relay;
    relay.edge_depth = kEdgeDepth;
    relay.with_radiance = false;
    relay.split = [&](const RelayPatch& patch) {
      const auto [u, v] = excess(patch, brightness);
      if (std::max(u, v) <= 1) return 0;
      return u >= v ? 1 : 2;
    };
    if (rules_) {
      relay.most_points = kMaxRulePoints;
      relay.points = [&](const RelayPatch& patch, const CellPlaces& places) {
        return rule_points(patch, places, brightness);
      };
    }
    relay.nodes = [&](const RelayPatch& patch) -> std::array<int, 2> {
      const double edge = 2 * std::max(patch.half_u.norm(), patch.half_v.norm());
      const bool wide = edge > limits_.midpoint * objects_.nearest(patch.center);
      return pairs_ || wide ? std::array{2, 2} : std::array{1, 1};
    };
    return relay;
  }

  /// Fractional number of Gauss-Legendre points along both edges of a cell. Over a path that
  /// changes by 2 a, n points have an error of exp(-2 (n s / a)^2), where s is the pulse's width.
  /// The same holds for the angle and the width of a BRDF's lobe.
  /// For inverse squares of a distance r over a half edge h, the error is exp(-2 n asinh(r / h)).
  /// Few points have a larger error: two or three have the error that the formula gives for 0.13
  /// ln(1 / error) fewer (from the rules' error terms). A cell's allowed error is the tolerance as
  /// a share of all light, so a dim cell needs few points.
  std::array<double, 2> rule_points(const RelayPatch& patch, const CellPlaces& places,
                                    const Brightness& brightness) const {
    const double digits = std::log1p(brightness.share(patch) / limits_.rule_share);
    const auto ranges = objects_.ranges(places, view_.setup.origin());
    const auto along = [&](double path, double angle) {
      const double for_pulse =
          std::max(path / limits_.pulse_sigma, angle / limits_.lobe) * std::sqrt(digits / 2);
      const double for_distance = 0.5 * digits / std::asinh(1 / angle);
      return (std::max(for_pulse, for_distance) + kFewPoints * digits) / limits_.coarseness;
    };
    return {along(ranges.path_u, ranges.angle_u), along(ranges.path_v, ranges.angle_v)};
  }

  /// Ratio of a patch's spread or angle to its limit along half_u and half_v.
  std::array<double, 2> excess(const RelayPatch& patch, const Brightness& brightness) const {
    const double below = std::max(brightness.share_below(brightness.density(patch)), 1e-6);
    const double relaxed = std::max(1.0, std::pow(0.5 / below, 0.15));
    const auto [path_u, path_v, near] =
        objects_.changes(patch, (patch.center - view_.setup.origin()).normalized());
    const double spread = limits_.spread;
    const double angle = limits_.aspect;
    const double legs = (single_ ? 2 : 1) / std::sqrt(3.0);
    const double turn = 2 * std::sqrt(near) / angle;
    return {std::max(legs * std::sqrt(path_u) / spread, patch.half_u.norm() * turn) / relaxed,
            std::max(legs * std::sqrt(path_v) / spread, patch.half_v.norm() * turn) / relaxed};
  }

  /// Leaves out dim parts: those that, together with all parts up to twice as bright, hold less
  /// than a negligible share. The margin is for cells dimmer than any cell that Brightness knows.
  std::vector<WeightedPatch> prune(std::vector<WeightedPatch> patches, const Brightness& brightness,
                                   Sampling& into) const {
    into.dim_patches += static_cast<int>(std::erase_if(patches, [&](const WeightedPatch& p) {
      return brightness.share_below(2 * brightness.density(p.patch)) < negligible_;
    }));
    return patches;
  }

  const SensorView& view_;
  Limits limits_;
  ProbedMiddles objects_;
  bool single_, rules_, pairs_;
  double negligible_;
};

/// Patches in the object's own frame at a probed placement, in lanes.
struct SeenFromObject {
  std::vector<double> x, y, z, counts;
  std::vector<double> nx, ny, nz;  ///< normals
  std::vector<double> light;       ///< from the patch to the detector, up to a constant
  /// m^2, spread of the several patches that one patch stands for. A placement that happens to
  /// touch this patch is no nearer to the light than that.
  std::vector<double> nearest2;
  double size = 1;
  bool pairs = false;  ///< the light is a sum over pairs of patches
};

/// Light that a cell would exchange, and this light times the squared changes of the path and of
/// the direction over the cell. Where pairs resolve the lobe, only one form factor counts, because
/// the lobe sends a patch's light back to around the patch. With two, an object beside the lit
/// relay had thousands of points.
struct CellSums {
  double weight = 0, path = 0, angle = 0;
};

BLINDCORNER_MULTIVERSION void add_cell(const SurfaceCell& cell, const SeenFromObject& from,
                                       CellSums& sums) {
  const double size = from.size;
  const double cx = size * cell.center.x(), cy = size * cell.center.y(),
               cz = size * cell.center.z();
  const double nx = cell.normal.x(), ny = cell.normal.y(), nz = cell.normal.z();
  const double ux = size * cell.half_u.x(), uy = size * cell.half_u.y(),
               uz = size * cell.half_u.z();
  const double vx = size * cell.half_v.x(), vy = size * cell.half_v.y(),
               vz = size * cell.half_v.z();
  alignas(64) std::array<double, kLanes> weight{}, path{}, angle{};
  for (std::size_t i = 0; i < from.x.size(); i += kLanes) {
    for (std::size_t k = 0; k < kLanes; ++k) {
      const double x = from.x[i + k] - cx, y = from.y[i + k] - cy, z = from.z[i + k] - cz;
      const double inverse2 = 1 / std::max(x * x + y * y + z * z, from.nearest2[i + k]);
      const double along = std::max(x * nx + y * ny + z * nz, 0.0);
      const double below =
          std::max(-x * from.nx[i + k] - y * from.ny[i + k] - z * from.nz[i + k], 0.0);
      const double once = from.light[i + k] * along * below * inverse2 * inverse2;
      const double twice = from.counts[i + k] * along * along * inverse2 * inverse2 * inverse2;
      const double w = from.pairs ? once : twice;
      const double u = x * ux + y * uy + z * uz;
      const double v = x * vx + y * vy + z * vz;
      weight[k] += w;
      path[k] += w * inverse2 * std::max(u * u, v * v);
      angle[k] += w * inverse2;
    }
  }
  const double area = size * size * cell.area;
  const double edge2 = size * size * std::max(cell.half_u.squaredNorm(), cell.half_v.squaredNorm());
  for (std::size_t k = 0; k < kLanes; ++k) {
    sums.weight += area * weight[k];
    sums.path += area * 4.0 / 3 * path[k];
    sums.angle += area * 4 * edge2 * angle[k];
  }
}

std::vector<SeenFromObject> seen_from_probes(const PatchArrays& seen, const SceneTransport& of,
                                             bool pairs) {
  std::vector<SeenFromObject> views;
  // Some 64 patches are taken, by judgement: the light that a cell exchanges with them is only a
  // weight.
  const int stride = std::max(1, seen.size() / 64);
  for (std::size_t p = 0; p < of.probes.size(); ++p) {
    const Transform to_object = of.T_world_probes[p].inverse(Eigen::Isometry);
    SeenFromObject& view = views.emplace_back();
    view.size = of.probes[p].size;
    view.pairs = pairs;
    for (int i = 0; i < seen.size(); i += stride) {
      const Vector3d q = to_object * seen.center(i);
      view.x.push_back(q.x());
      view.y.push_back(q.y());
      view.z.push_back(q.z());
      const Vector3d normal = to_object.linear() * seen.normal(i);
      view.nx.push_back(normal.x());
      view.ny.push_back(normal.y());
      view.nz.push_back(normal.z());
      view.light.push_back(seen.weight[static_cast<std::size_t>(i)]);
      view.counts.push_back(1);
      const double area = 4 * seen.half_u(i).cross(seen.half_v(i)).norm();
      view.nearest2.push_back(stride * area / (2 * kPi));  // mean square within a disc
    }
    while (view.counts.size() % kLanes != 0) {
      for (auto* v : {&view.x, &view.y, &view.z, &view.nx, &view.ny, &view.nz, &view.nearest2}) {
        v->push_back(v->back());
      }
      view.light.push_back(0);
      view.counts.push_back(0);
    }
  }
  return views;
}

/// Assigns each cell to the tile whose lobes it shares. The light that a lobe gathers about a patch
/// changes slowly over the object (the footprint's size and shape do, not its middle). The middle
/// of several cells is therefore enough for them: the error is of second order in their extent over
/// the distance.
void sample_anchors(const Shape& shape, double edge, Sampling& into) {
  const Transform own = Transform::Identity();
  const auto cells = divide(shape, own, 1.0, into.object_edge, 1);
  const auto tiles = divide(shape, own, 1.0, std::max(edge, into.object_edge), 1);
  into.anchors = tiles.size();
  for (const SurfaceCell& cell : cells) {
    const auto far = [&](const SurfaceCell& tile) {
      const bool turned = tile.normal.dot(cell.normal) < kSameSide;
      return std::make_pair(turned, (tile.center - cell.center).squaredNorm());
    };
    const auto nearest = std::ranges::min_element(tiles, {}, far);
    into.anchor.push_back(static_cast<std::size_t>(nearest - tiles.begin()));
  }
}

/// Largest spacing of points on a matt object. It follows from the change of paths and the distance
/// of the light: root mean squares over even cells, each weighted with the light that it would
/// exchange.
PointSpacing spacing_of(const std::vector<SurfaceCell>& cells,
                        const std::vector<SeenFromObject>& seen_from, const Limits& limits) {
  double light = 0, near = 0;
  std::array<double, 2> path{};   // weighted squared gradient, one way, per own metre: across, up
  std::array<double, 2> edges{};  // sums of these weights
  for (const SeenFromObject& from : seen_from) {
    const double size2 = from.size * from.size;
    for (const SurfaceCell& cell : cells) {
      const std::array<Vector3d, 2> along{cell.half_u.normalized(), cell.half_v.normalized()};
      double own = 0;
      std::array<double, 2> changes{};
      for (std::size_t i = 0; i < from.x.size(); ++i) {
        const Vector3d way = Vector3d(from.x[i], from.y[i], from.z[i]) - from.size * cell.center;
        const double inverse2 = 1 / std::max(way.squaredNorm(), from.nearest2[i]);
        const double facing = std::max(way.dot(cell.normal), 0.0);
        const double w =
            from.counts[i] * size2 * cell.area * facing * facing * inverse2 * inverse2 * inverse2;
        own += w;
        near += w * size2 * inverse2;
        for (std::size_t k = 0; k < 2; ++k) {
          changes[k] += w * size2 * inverse2 * std::pow(way.dot(along[k]), 2);
        }
      }
      light += own;
      for (std::size_t k = 0; k < 2; ++k) {
        const std::size_t upright = std::abs(along[k].z()) > kUpright ? 1 : 0;
        path[upright] += changes[k];
        edges[upright] += own;
      }
    }
  }
  const auto spacing = [&](std::size_t k) {
    const double gradient = edges[k] > 0 ? std::sqrt(path[k] / edges[k]) : 0.0;
    const double spread = std::sqrt(3.0) * limits.rule_spread / std::max(gradient, 1e-9);
    return std::min(spread, limits.object_angle * std::sqrt(light / std::max(near, 1e-300)));
  };
  return {spacing(0), spacing(1)};
}

/// Divides the object until its cells meet both limits. Cells are weighted with the light that they
/// would exchange with the sampled relay.
void sample_object(const SensorView& view, const SamplingNeeds& needs, Sampling& into) {
  const HiddenObject& hidden = view.transport->scene.hidden;
  const Limits limits(needs, needs.sampling_step.object, hidden);
  const bool rules = by_rules(needs.kernel);
  const double extent = 2 * bounding_radius(hidden.shape, Anchor::center);
  const auto seen_from =
      seen_from_probes(into.seen, *view.transport, needs.kernel == Kernel::retro_pairs);
  std::vector<SurfaceCell> cells;
  if (rules) {
    cells = divide(hidden.shape, Transform::Identity(), 1.0, extent / kEvenCells, 1);
    into.points = quadrature(hidden.shape, spacing_of(cells, seen_from, limits));
    into.object_nodes = static_cast<int>(into.points.size());
    return;
  }
  CellSums sums;
  double angle = 1;  // edge over distance of cells, root mean square
  // In steps of a quarter, so that cells are not much finer than necessary. The smallest edge
  // limits the time, by judgement.
  for (into.object_edge = extent; into.object_edge > extent / 64; into.object_edge /= 1.25) {
    const std::size_t before = cells.size();
    cells = divide(hidden.shape, Transform::Identity(), 1.0, into.object_edge, 1);
    if (cells.size() == before) continue;  // the same cells as with longer edges
    sums = {};
    for (const SeenFromObject& from : seen_from) {
      for (const SurfaceCell& cell : cells) add_cell(cell, from, sums);
    }
    if (sums.weight <= 0) continue;
    angle = std::sqrt(sums.angle / sums.weight);
    if (std::sqrt(sums.path / sums.weight) <= limits.spread && angle <= limits.aspect) break;
  }
  into.object_midpoint = sums.weight > 0 && angle <= limits.midpoint;
  cells = divide(hidden.shape, Transform::Identity(), 1.0, into.object_edge, 1);
  into.object_nodes = static_cast<int>(cells.size()) * (into.object_midpoint ? 1 : kNodes);
  if (needs.kernel == Kernel::retro_single && !view.setup.uses_points()) {
    sample_anchors(hidden.shape, into.object_edge * kAnchorEdge * limits.midpoint / angle, into);
  }
}

}  // namespace

SensorView::SensorView(std::shared_ptr<const SceneTransport> of, const SensorPlacement& at,
                       const PlanOverrides& overrides)
    : transport(std::move(of)),
      placement(at),
      setup(transport->scene, placement, transport->rays),
      confocal(transport->scene.sensor.illumination == Illumination::confocal) {
  // The coarse patches choose kernels and borders, and no light is summed over them. By judgement.
  RelaySampling coarse;
  coarse.centers_only = true;
  coarse.with_radiance = false;
  const auto look = [](const std::vector<WeightedPatch>& patches, std::vector<RelayPatch>& into) {
    for (const WeightedPatch& p : patches) into.push_back(p.patch);
  };
  coarse.divisions = 5;
  for (int z = 0; z < transport->scene.sensor.zone_count(); ++z) {
    if (!dead(z)) look(setup.seen(z, coarse), seen);
  }
  coarse.divisions = 12;
  if (!confocal) look(setup.lit(coarse), lit);
  // Throws if nothing is lit or seen.
  if (seen.empty() || (!confocal && lit.empty())) setup.relay_points();
  std::vector<Vector3d> corners;
  if (std::holds_alternative<RetroreflectiveMaterial>(transport->scene.hidden.material)) {
    lit_extent = setup.lit_extent();
    for (const auto* patches : {&lit, &seen}) {
      for (const RelayPatch& p : *patches) {
        for (const double u : {-1.0, 1.0}) {
          for (const double v : {-1.0, 1.0})
            corners.push_back(p.center + u * p.half_u + v * p.half_v);
        }
      }
    }
  }
  kernel = choose_kernel(transport->scene, corners, lit_extent, overrides);
}

Sampling sample(const SensorView& view, const SamplingNeeds& needs) {
  Sampling made;
  RelaySampler(view, needs).sample(made);
  sample_object(view, needs, made);
  return made;
}

}  // namespace blindcorner
