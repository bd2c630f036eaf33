// SPDX-License-Identifier: Apache-2.0
/// The fast model: sums over light arriving and light leaving instead of pairs of paths.
///
/// For a point q of a Lambertian object, light arriving at q and light leaving q towards a zone are
/// two independent sums, so their path-length distributions convolve. Each is laid on a grid of
/// paths (path_grid.h); the pairs of all object points of a zone are summed there and become bins
/// once. Relay and object are sampled by Gauss-Legendre rules: what they integrate is smooth but
/// for shadows' edges, so that few points do. A rule of n points over a stretch whose path changes
/// by 2a errs like exp(-2 (n s / a)^2), s the pulse's width, as long as it resolves the inverse
/// squares too.
///
/// A retroreflector sends light back to where it came from: groups of relay patches, or pairs of
/// them, are one pulse each, of their weight, mean path and path variance. Pulses with nearly the
/// same path share one: each adds its moments to the two nearest cells of a path axis, in
/// proportion to nearness, so the sum stays continuous in the pose and every moment up to the
/// second is kept.
#include "forward/transport/fast_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <mutex>
#include <span>
#include <string>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "forward/transport/lobe_field.h"
#include "forward/transport/lobe_pairs.h"
#include "forward/transport/measured_law_model.h"
#include "forward/transport/static_bounces.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Width of a path cell in pulse standard deviations: pairs in one cell differ by a spread of
/// s = 0.4^2 / 6 = 0.03, whose closure error is below 1e-4. Wider cells leave kinks in the pose.
constexpr double kPathCell = 0.4;
/// What leaving out dim patches may change a bin by, in units of the tolerance: the shares are
/// means over the probed placements, and a pose near the dim patches sees more of them.
constexpr double kDimBound = 0.3;
/// Less than this of a lobe's light is none.
constexpr double kNoShare = 1e-7;

/// Sampling of the known scene's own later bounces, which a fit needs once per sensor placement,
/// and of the estimate that decides whether it needs them.
constexpr StaticSampling kBounces{1, 5, 1.5, 24};
constexpr StaticSampling kBouncesEstimate{1, 3, 4.0, 8};
/// Later bounces below this share of the tolerance are left out: the estimate's own uncertainty.
constexpr double kBouncesMatter = 0.5;

/// Largest standard deviation of a pulse's path, in those of the sensor's own pulse. Points of a
/// rule have none, sampling keeps that of a group of patches below two; a lobe on a grazing relay
/// spreads paths of its own.
double widest_blur(const TransportPlan& plan) {
  switch (plan.kernel) {
    case Kernel::lambertian:
      return 0;
    case Kernel::retro_single:
      return 6;
    case Kernel::retro_pairs:
      break;
  }
  return 2;
}

}  // namespace

FastModel::FastModel(const Scene& scene, const SensorPlacement& placement,
                     const FastModelOptions& options)
    : scene_(scene),
      overrides_(options.overrides),
      setup_(scene_, placement),
      plan_(make_plan(scene_, setup_.relay_points(), setup_.lit_extent(), overrides_)),
      all_occluders_(occluder_faces(scene_.surfaces)),
      confocal_(scene.sensor.illumination == Illumination::confocal),
      pulse_sigma_(kSpeedOfLight * std::hypot(scene.sensor.response.core_sigma(),
                                              scene.sensor.bin_width / std::sqrt(12.0),
                                              options.extra_pulse_sigma)),
      extra_variance_(options.extra_pulse_sigma * options.extra_pulse_sigma),
      pulses_(scene.sensor.response, scene.sensor.bin_width,
              extra_variance_ + std::pow(widest_blur(plan_) * pulse_sigma_ / kSpeedOfLight, 2),
              1e-4),
      axis_bins_(unwrapped_bins(scene.sensor)),
      bins_per_metre_(1 / (kSpeedOfLight * scene.sensor.bin_width)),
      cells_per_metre_(1 / (kPathCell * pulse_sigma_)),
      path_cells_(static_cast<int>(axis_bins_ / bins_per_metre_ * cells_per_metre_) +
                  2 * kCellMargin) {
  if (plan_.kernel == Kernel::retro_single && !setup_.uses_points()) {
    lobe_.emplace(scene_, placement);
  }
  if (plan_.kernel == Kernel::lambertian) {
    // Counted from the relay, legs are short by the way from it.
    double way_back = 0;
    if (scene.sensor.path_origin == PathOrigin::relay) {
      for (const Vector3d& p : setup_.relay_points()) {
        way_back = std::max(way_back, (p - setup_.origin()).norm());
      }
    }
    one_arrival_ = arrives_at_once(options.tolerance);
    grid_.emplace(scene.sensor, one_arrival_ ? PathGrid::Paths::whole : PathGrid::Paths::legs,
                  extra_variance_, axis_bins_, way_back, options.tolerance);
  }
  choose_fidelity(options);
  complete_plan(options.tolerance);
  decide_bounces(options.tolerance);
}

std::string FastModel::two_digits(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2g", value);
  return text;
}

/// Decisions that need the sampled relay.
void FastModel::complete_plan(double tolerance) {
  decide_view(plan_, scene_, setup_.view_hull());

  PlanDecision dim{Term::dim_patches, "dim relay patches", false, "", kDimBound * tolerance};
  dim.reason = std::to_string(dim_patches_) + " of " +
               std::to_string(dim_patches_ + lit_.size() + seen_.size()) +
               " relay patches exchange less than " + two_digits(kNegligible * tolerance) +
               " of the light with the search region";
  plan_.decide(dim);
  if (plan_.kernel == Kernel::lambertian) {
    PlanDecision pairs = plan_.decision(Term::patch_pairs);
    pairs.reason += one_arrival_ ? ", one of which arrives at once" : ", which are convolved";
    pairs.reason += " on a grid of paths with a step of " + two_digits(1e3 * grid_->step()) + " mm";
    pairs.bound = tolerance;
    plan_.decide(pairs);
  } else {
    PlanDecision pairs = plan_.decision(Term::patch_pairs);
    // Pairs also divide the relay by the lobe: what coarser patches err by, the search's last
    // change and as much again for what it would go on to.
    pairs.bound = single_sum_bound() + std::max(tolerance, 2 * unresolved_);
    plan_.decide(pairs);
  }
  const auto [first, last] = reachable_bins();
  plan_.decide({Term::whole_axis, "bins that no light can reach", false,
                "light from the search region arrives in bins " + std::to_string(first) + " to " +
                    std::to_string(last) + " of " + std::to_string(axis_bins_)});
  const bool direct = scene_.linear.direct != LinearMode::fixed || scene_.linear.fixed_direct > 0;
  std::string reason = direct ? "captures hold it: computed once, it does not depend on the pose"
                              : "captures hold none";
  if (scene_.sensor.has_background()) reason += "; measured background comes on top";
  plan_.decide({Term::direct_return, "direct return of the known surfaces", direct, reason});
}

namespace {

/// What one pulse, of the right mean and of the variance that two points of the lobe give, leaves
/// out of the light that a lobe gathers on the tilted relay, relative to the pulse's peak.
///
/// Turned by z standard deviations along the tilt (angle t off the normal, lobe s, distance r), the
/// lobe meets the relay a way x = r s z / cos t (1 + s tan t z + ...) off, and the path changes by
/// a z + b z^2 with a = r s / cos t times the path's gradient and b = a s tan t. The two points
/// miss the variance 2 b^2, which lowers the peak of a pulse of width w by b^2 / w^2; a Gaussian
/// misses the third cumulant k = 6 a^2 b + 8 b^3, by max |He3 phi| / phi(0) k / (6 w^3) = 0.23 k /
/// w^3. An edge that cuts the lobe makes it lopsided besides: at most k = 0.22 a^3, of a half
/// normal distribution. Oblique edges that meet lose 0.03 of the lobe at the corner.
struct LobeClosure {
  double smooth;   ///< of all light
  double at_edge;  ///< of light within a footprint of an edge

  LobeClosure(double a, double bend, double pulse) {
    const double b = a * std::min(bend, 1.0);
    const double w = std::sqrt(pulse * pulse + a * a);
    const auto skew = [&](double k) { return 0.23 * k / (w * w * w); };
    smooth = std::min(b * b / (w * w) + skew(6 * a * a * b + 8 * b * b * b), 1.0);
    at_edge = std::min(skew(0.22 * a * a * a) + 0.03, 1.0);
  }
};

}  // namespace

/// Largest change of a bin, as a share of the peak, when pairs of patches replace the single sum:
/// what LobeClosure leaves out, averaged over each zone's light and relative to the brightest
/// zone's, at the worst of the probed placements. Edges count for the share of a bin's light within
/// a footprint on either side of two edges; a bin sees the share kBinShare of the lit spot.
double FastModel::single_sum_bound() const {
  const auto* retro = std::get_if<RetroreflectiveMaterial>(&scene_.hidden.material);
  const double extent = setup_.lit_extent();
  if (retro == nullptr || extent <= 0) return 0.0;
  constexpr double kBinShare = 0.12;  // a pulse of 4 cm of path on a spot of 0.6 m: 0.07 to 0.3
  const double sigma = retro->lobe_sigma;
  double bound = 0;
  std::vector<double> light(scene_.sensor.zones.size());
  std::vector<double> lost(light.size());
  for (const Placement& p : probe_placements(scene_)) {
    const Vector3d q = object_to_world(scene_.hidden.shape, scene_.hidden.anchor, p).translation();
    std::fill(light.begin(), light.end(), 0.0);
    std::fill(lost.begin(), lost.end(), 0.0);
    for (int i = 0, group = 0; i < seen_.size(); ++i) {
      while (i >= seen_.group_end[static_cast<std::size_t>(group)]) ++group;
      const Vector3d way = q - seen_.center(i);
      const double r = way.norm();
      const Vector3d normal = seen_.normal(i);
      const double cosine = std::max(way.dot(normal) / r, 0.5 * sigma);
      if (way.dot(normal) <= 0) continue;
      const auto k = static_cast<std::size_t>(i);
      const double weight = seen_.weight[k] * seen_.radiance[k] * cosine / (r * r);
      // Along the tilt, on the relay.
      const Vector3d tilt = way / r - normal * way.dot(normal) / r;
      const double sine = tilt.norm();
      const Vector3d gradient = seen_.leg_direction(i) - way / r;
      const double slope = sine > 0 ? std::abs(gradient.dot(tilt)) / sine : 0.0;
      const double footprint = sigma * r / cosine;
      const LobeClosure closure(footprint * slope, sigma * sine / cosine, pulse_sigma_);
      const double near_edges = std::min(4 * footprint / (kBinShare * extent), 1.0);
      const auto zone = static_cast<std::size_t>(seen_.group_zone[static_cast<std::size_t>(group)]);
      light[zone] += weight;
      lost[zone] += weight * (closure.smooth + near_edges * closure.at_edge);
    }
    const double brightest = *std::max_element(light.begin(), light.end());
    if (brightest > 0) {
      bound = std::max(bound, *std::max_element(lost.begin(), lost.end()) / brightest);
    }
  }
  return bound;
}

/// First and last bin of any zone that light from the search region can reach, by the shortest and
/// longest paths by way of a ball around each probed placement.
std::pair<int, int> FastModel::reachable_bins() const {
  double square = 0;
  double radius = 0;
  for (const Unknown& unknown : scene_.unknowns) {
    if (unknown.component <= Component::z) square += std::pow(unknown.range() / 4, 2);
  }
  for (const Placement& p : probe_placements(scene_)) {
    radius = std::max(radius, p.size * bounding_radius(scene_.hidden.shape, Anchor::center));
  }
  radius += std::sqrt(square);
  const auto legs = [&](const PatchArrays& a, const Vector3d& q) {
    std::pair<double, double> range{std::numeric_limits<double>::infinity(), 0};
    for (int i = 0; i < a.size(); ++i) {
      const double path = a.leg[static_cast<std::size_t>(i)] + (a.center(i) - q).norm();
      const double slack = radius + 2 * (a.half_u(i).norm() + a.half_v(i).norm());
      range = {std::min(range.first, path - slack), std::max(range.second, path + slack)};
    }
    return range;
  };
  double shortest = std::numeric_limits<double>::infinity();
  double longest = 0;
  for (const Placement& p : probe_placements(scene_)) {
    const Vector3d q = object_to_world(scene_.hidden.shape, scene_.hidden.anchor, p).translation();
    const auto out = legs(seen_, q);
    const auto in = lit_.size() > 0 ? legs(lit_, q) : out;
    shortest = std::min(shortest, in.first + out.first);
    longest = std::max(longest, in.second + out.second);
  }
  if (!(shortest < longest)) return {0, -1};
  const auto [early, late] = std::ranges::minmax(scene_.sensor.zones, {}, &Zone::time_zero);
  const double bin = scene_.sensor.bin_width;
  const int first = pulses_.reach(early.time_zero / bin + shortest * bins_per_metre_).first;
  const int end = pulses_.reach(late.time_zero / bin + longest * bins_per_metre_).second;
  return {std::clamp(first, 0, axis_bins_), std::clamp(end, 0, axis_bins_) - 1};
}

/// Made when somebody asks: models that only score never do.
const HistogramCube& FastModel::direct_return() const {
  std::call_once(direct_once_, [this] {
    const Sensor& sensor = scene_.sensor;
    direct_ = HistogramCube(sensor.rows, sensor.columns, sensor.bins);
    if (scene_.linear.direct == LinearMode::fixed && scene_.linear.fixed_direct == 0) return;
    const PulseTable tails(sensor.response, sensor.bin_width,
                           std::pow(sensor.response.core_sigma(), 2), 1e-7);
    direct_ = setup_.direct_return(tails, 10, true);
    if (bounces_) StaticBounces(scene_, setup_, kBounces).add(nullptr, direct_);
    mix_zones(sensor, direct_);
  });
  return direct_;
}

/// Whether the known scene's own two- and three-bounce light matters beside the object's.
void FastModel::decide_bounces(double tolerance) {
  const Sensor& sensor = scene_.sensor;
  const auto decide = [&](bool used, const std::string& reason, double bound = 0) {
    bounces_ = overrides_.switched_on(Term::known_bounces) ||
               (used && !overrides_.switched_off(Term::known_bounces));
    plan_.decide({Term::known_bounces, "two and three bounces within the known scene", used, reason,
                  used ? 0.0 : bound});
  };
  if (scene_.linear.direct == LinearMode::fixed && scene_.linear.fixed_direct == 0) {
    return decide(false, "captures hold no light of the known scene");
  }
  const StaticBounces bounces(scene_, setup_, kBouncesEstimate);
  if (!bounces.any()) return decide(false, "no two reflecting surfaces face each other");
  HistogramCube light(sensor.rows, sensor.columns, sensor.bins);
  bounces.add(nullptr, light);
  double brightest = 0;
  HistogramCube object;
  for (const PoseVector& pose : probe_poses()) {
    three_bounce(pose, object);
    brightest = std::max(brightest, *std::max_element(object.values.begin(), object.values.end()));
  }
  const double share =
      *std::max_element(light.values.begin(), light.values.end()) / std::max(brightest, 1e-300);
  char text[96];
  std::snprintf(text, sizeof text, "its peak is about %.2g of the object's, the tolerance is %.2g",
                share, tolerance);
  decide(share > kBouncesMatter * tolerance, text, tolerance);
}

/// Weights, paths and directions between a node and all patches, shadows included.
void FastModel::light_between(const SurfacePoint& node, const PatchArrays& arrays,
                              const ShadowView* shadows, Scratch& s) const {
  exchange(node, arrays, s);
  shade_patches(node, arrays, shadows, s);
}

/// Takes shadows away from weights, paths and, where there are any, directions.
void FastModel::shade_patches(const SurfacePoint& node, const PatchArrays& arrays,
                              const ShadowView* shadows, Scratch& s) const {
  s.partial.clear();
  if (shadows == nullptr) return;
  for (const PatchArrays::Block& block : arrays.blocks) {
    const ShadowView::Sight sight = shadows->sight(block.center, block.radius);
    if (sight == ShadowView::Sight::clear) continue;
    if (sight == ShadowView::Sight::hidden) {
      std::fill(s.weight.begin() + block.begin, s.weight.begin() + block.end, 0.0);
      continue;
    }
    std::array<ShadowView::Sight, PatchArrays::kBlock> sights;
    shadows->sights(arrays.coordinates(), block.begin, block.end, sights.data());
    for (int i = block.begin; i < block.end; ++i) {
      const ShadowView::Sight own = sights[static_cast<std::size_t>(i - block.begin)];
      if (own == ShadowView::Sight::hidden) s.weight[static_cast<std::size_t>(i)] = 0;
      if (own == ShadowView::Sight::mixed) shade(node, arrays, *shadows, i, s);
    }
  }
}

/// Takes the shadowed part of one patch away.
void FastModel::shade(const SurfacePoint& node, const PatchArrays& arrays,
                      const ShadowView& shadows, int patch, Scratch& s) const {
  const auto k = static_cast<std::size_t>(patch);
  // What lies behind the object's surface is dark; a visible part may lie in front of it where the
  // patch's own point does not.
  const double reach = std::abs(node.normal.dot(arrays.half_u(patch))) +
                       std::abs(node.normal.dot(arrays.half_v(patch)));
  if (node.normal.dot(arrays.area_center(patch) - node.center) <= -reach) return;
  const VisiblePart part =
      shadows.see(arrays.area_center(patch), arrays.half_u(patch), arrays.half_v(patch));
  if (part.fraction >= 1) return;
  if (part.fraction <= 0) {
    s.weight[k] = 0;
    return;
  }
  s.partial.push_back({k, part});
  // The visible part's own centre.
  const Vector3d shift =
      part.shift + (1 - part.fraction) * (arrays.area_center(patch) - arrays.center(patch));
  const Vector3d way = arrays.center(patch) + shift - node.center;
  const double r = way.norm();
  const Vector3d direction = way / r;
  const double cell_cosine = std::max(direction.dot(node.normal), 0.0);
  const double relay_cosine = std::max(-direction.dot(arrays.normal(patch)), 0.0);
  s.weight[k] = part.fraction * arrays.weight[k] * cell_cosine * relay_cosine / (r * r);
  s.path[k] = arrays.leg[k] + arrays.leg_direction(patch).dot(shift) + r;
  s.variance[k] *= part.fraction * part.fraction;
  s.dx[k] = direction.x();
  s.dy[k] = direction.y();
  s.dz[k] = direction.z();
  s.cosine[k] = cell_cosine;
}

/// Pulses [begin, end) go to the cells of a zone.
void FastModel::add_pulses(Scratch& s, int zone, std::size_t begin, std::size_t end) const {
  add_to_cells(s.pulses, begin, end, cells_per_metre_, path_cells_,
               s.cells.data() + static_cast<std::ptrdiff_t>(zone) * path_cells_,
               s.touched[static_cast<std::size_t>(zone)]);
}

/// All pulses, given as sums, go to the zones of the seen groups, one for each.
void FastModel::add_seen_pulses(Scratch& s) const {
  const std::size_t groups = seen_.group_zone.size();
  normalise(s.pulses, groups);
  for (std::size_t begin = 0; begin < groups;) {
    std::size_t end = begin;
    while (end < groups && seen_.group_zone[end] == seen_.group_zone[begin]) ++end;
    add_pulses(s, seen_.group_zone[begin], begin, end);
    begin = end;
  }
}

/// One pulse for each path cell that holds light; leaves the cells empty.
void FastModel::flush(Scratch& s) const {
  for (int z = 0; z < scene_.sensor.zone_count(); ++z) {
    if (grid_) {
      PathLight& pairs = s.pairs[static_cast<std::size_t>(z)];
      if (overrides_.switched_on(Term::whole_axis)) pairs.take_all();
      grid_->add_to_row(z, pairs, s.rows + static_cast<std::ptrdiff_t>(z) * axis_bins_);
      pairs.clear();
      continue;
    }
    const double start =
        scene_.sensor.zones[static_cast<std::size_t>(z)].time_zero / scene_.sensor.bin_width;
    Sums* cells = s.cells.data() + static_cast<std::ptrdiff_t>(z) * path_cells_;
    double* row = s.rows + static_cast<std::ptrdiff_t>(z) * axis_bins_;
    Range& touched = s.touched[static_cast<std::size_t>(z)];
    if (overrides_.switched_on(Term::whole_axis)) touched = {0, path_cells_};
    for (int c = touched.begin; c < touched.end; ++c) {
      if (cells[c].weight <= 0) continue;
      const double mean = cells[c].first / cells[c].weight;
      const double variance = std::max(cells[c].second / cells[c].weight - mean * mean, 0.0);
      const double path = (c - kCellMargin) / cells_per_metre_ + mean;
      pulses_.add(row, axis_bins_, start + path * bins_per_metre_,
                  variance / (kSpeedOfLight * kSpeedOfLight) + extra_variance_, cells[c].weight);
    }
    if (touched.begin < touched.end) std::fill(cells + touched.begin, cells + touched.end, Sums{});
    touched = {};
  }
}

/// Light arriving at an object point, convolved with the light that leaves it to each zone.
void FastModel::lambertian(const SurfacePoint& point, const ShadowView* shadows, Scratch& s) const {
  const double scale = scene_.hidden.albedo / kPi * point.area;
  exchange_paths(point, relay_, s);
  shade_patches(point, relay_, shadows, s);
  if (overrides_.switched_on(Term::patch_pairs)) return all_pairs(scale, s);
  if (one_arrival_) return pair_with_one(scale, s);
  grid_->find_splines(s.path.data(), s.weight.data(), relay_.size(), s.splines);
  const std::size_t lit_sets = lit_.set_end.size();
  const std::size_t zones = seen_.set_end.size();
  const auto lay = [&](std::size_t set, PathLight& light) {
    const auto [begin, end] = relay_.set(set);
    grid_->lay(s.splines, begin, end, light);
  };
  if (!confocal_) lay(0, s.arriving);
  for (std::size_t z = 0; z < zones; ++z) {
    if (confocal_) lay(z, s.arriving);
    if (s.arriving.dark()) continue;
    lay(lit_sets + z, s.leaving);
    grid_->pair(s.arriving, s.leaving, scale, s.pairs[z]);
  }
}

/// The same where what arrives has one path: whole paths, without a convolution.
void FastModel::pair_with_one(double scale, Scratch& s) const {
  const std::size_t lit_sets = lit_.set_end.size();
  const std::size_t zones = seen_.set_end.size();
  const auto first = static_cast<std::size_t>(lit_.size());
  for (std::size_t set = 0; set < lit_sets; ++set) {
    double weight = 0, path = 0;
    const auto [in_begin, in_end] = relay_.set(set);
    for (std::size_t p = in_begin; p < in_end; ++p) {
      weight += s.weight[p];
      path += s.weight[p] * s.path[p];
    }
    if (weight > 0) path /= weight;
    // A flash lights all zones, a confocal set its own.
    const std::size_t begin = relay_.set(lit_sets + (confocal_ ? set : 0)).first;
    const std::size_t end = relay_.set(lit_sets + (confocal_ ? set : zones - 1)).second;
    for (std::size_t r = begin; r < end; ++r) {
      s.weight[r] *= scale * weight;
      s.path[r] += path;
    }
  }
  grid_->find_splines(s.path.data() + first, s.weight.data() + first, seen_.size(), s.splines);
  for (std::size_t z = 0; z < zones; ++z) {
    const auto [begin, end] = relay_.set(lit_sets + z);
    grid_->add(s.splines, begin - first, end - first, s.pairs[z]);
  }
}

/// The same without the grid: one pulse for each pair.
void FastModel::all_pairs(double scale, Scratch& s) const {
  const std::size_t lit_sets = lit_.set_end.size();
  for (std::size_t z = 0; z < seen_.set_end.size(); ++z) {
    const double start = scene_.sensor.zones[z].time_zero / scene_.sensor.bin_width;
    double* row = s.rows + static_cast<std::ptrdiff_t>(z) * axis_bins_;
    const auto [in_begin, in_end] = relay_.set(confocal_ ? z : 0);
    const auto [out_begin, out_end] = relay_.set(lit_sets + z);
    for (std::size_t r = out_begin; r < out_end; ++r) {
      for (std::size_t p = in_begin; p < in_end; ++p) {
        const double light = scale * s.weight[p] * s.weight[r];
        if (light <= 0) continue;
        pulses_.add(row, axis_bins_, start + (s.path[p] + s.path[r]) * bins_per_metre_,
                    extra_variance_, light);
      }
    }
  }
}

/// The lobe is small against the lit spot: light comes back from about where it fell. Integrating
/// the lobe over p leaves the radiance about r, and the fall-off is 1/r^2. `occluders` of each
/// node, or one list for all.
void FastModel::retro_single(const CellNodes& cell, std::size_t anchor, const Shadows& shadows,
                             std::span<const std::vector<OccluderFace>> occluders,
                             Scratch& s) const {
  const double sigma = std::get<RetroreflectiveMaterial>(scene_.hidden.material).lobe_sigma;
  // Both outer legs are the patch's own; counted from the relay they cancel.
  const double way_in = scene_.sensor.path_origin == PathOrigin::sensor ? 1 : 0;
  const std::size_t groups = seen_.group_end.size();
  const auto patches = static_cast<std::size_t>(seen_.size());
  s.patches.resize(patches);
  s.pulses.resize(groups);
  std::fill_n(s.pulses.weight.begin(), groups, 0.0);
  std::fill_n(s.pulses.path.begin(), groups, 0.0);
  std::fill_n(s.pulses.variance.begin(), groups, 0.0);
  for (std::size_t n = 0; n < cell.count; ++n) {
    const SurfacePoint& node = cell.nodes[n];
    light_between(node, seen_, shadows.empty() ? nullptr : &shadows[n], s);
    const double scale = scene_.hidden.albedo * node.area;
    if (lobe_) {
      inner_legs(s);
      lobe_light_of_patches(s, patches, s.lobes[anchor], scale, cell.half_u, cell.half_v,
                            s.patches);
      const auto& faces = occluders[std::min(n, occluders.size() - 1)];
      if (!faces.empty()) shade_lobes(node, faces, s);
    } else {
      retro_light_of_patches(s, seen_, scale, cell.half_u, cell.half_v, sigma, way_in, s.patches);
    }
    std::size_t i = 0;
    for (std::size_t g = 0; g < groups; ++g) {
      for (const auto end = static_cast<std::size_t>(seen_.group_end[g]); i < end; ++i) {
        s.pulses.weight[g] += s.patches.weight[i];
        s.pulses.path[g] += s.patches.first[i];
        s.pulses.variance[g] += s.patches.second[i];
      }
    }
  }
  add_seen_pulses(s);
}

LobeRays FastModel::lobe_rays(const Vector3d& normal, const Scratch& s) const {
  return {s.dx.data(),     s.dy.data(),     s.dz.data(),     s.distance.data(),
          s.path.data(),   s.extent.data(), seen_.lx.data(), seen_.ly.data(),
          seen_.lz.data(), seen_.ux.data(), seen_.uy.data(), seen_.uz.data(),
          seen_.vx.data(), seen_.vy.data(), seen_.vz.data(), normal};
}

/// Visits the patches that lobes may be asked about together: zone, first and one past the last.
void FastModel::for_each_zone(
    const std::function<void(int, std::size_t, std::size_t)>& visit) const {
  for (std::size_t g = 0, begin = 0; g < seen_.group_end.size();) {
    const int zone = seen_.group_zone[g];
    while (g < seen_.group_end.size() && (!confocal_ || seen_.group_zone[g] == zone)) ++g;
    const auto end = static_cast<std::size_t>(seen_.group_end[g - 1]);
    visit(zone, begin, end);
    begin = end;
  }
}

namespace {

/// Clears the first `count` sums, to be added to.
LobeSums lobe_sums(LightSums& sums, std::size_t count) {
  for (auto* v : {&sums.weight, &sums.first, &sums.second}) std::fill_n(v->begin(), count, 0.0);
  return {sums.weight.data(), sums.first.data(), sums.second.data()};
}

}  // namespace

/// Inner legs of the ways out in `s`.
void FastModel::inner_legs(Scratch& s) const {
  s.distance.resize(static_cast<std::size_t>(seen_.size()));
  for (std::size_t i = 0; i < s.distance.size(); ++i) s.distance[i] = s.path[i] - seen_.leg[i];
}

/// What lobes about all patches gather, without occluders.
void FastModel::gather(const SurfacePoint& anchor, LobeLight& light, Scratch& s) const {
  const auto count = static_cast<std::size_t>(seen_.size());
  exchange(anchor, seen_, s);
  inner_legs(s);
  s.extent.assign(seen_.spread.begin(), seen_.spread.end());
  s.patches.resize(count);
  const LobeField::View view = lobe_->seen_from(anchor.center, {});
  const LobeRays rays = lobe_rays(anchor.normal, s);
  const LobeSums sums = lobe_sums(s.patches, count);
  for_each_zone([&](int zone, std::size_t begin, std::size_t end) {
    view.gather(rays.from(begin), end - begin, zone, sums.from(begin));
  });
  light.resize(count);
  lobe_moments(s, count, s.patches, light);
  light.known = true;
}

/// Takes away what occluders hide of the lobes of one node: the share of the light and its paths'
/// change, about those patches that shadows come near.
void FastModel::shade_lobes(const SurfacePoint& node, const std::vector<OccluderFace>& occluders,
                            Scratch& s) const {
  s.extent.assign(seen_.spread.begin(), seen_.spread.end());
  for (const auto& [patch, part] : s.partial) s.extent[patch] *= part.fraction * part.fraction;
  const LobeField::View view = lobe_->seen_from(node.center, occluders);
  const LobeRays rays = lobe_rays(node.normal, s);
  s.open.resize(LobeField::kChunk);
  s.shaded.resize(LobeField::kChunk);
  for_each_zone([&](int zone, std::size_t first, std::size_t end) {
    for (std::size_t begin = first; begin < end; begin += LobeField::kChunk) {
      const std::size_t count = std::min(LobeField::kChunk, end - begin);
      const double* weight = s.patches.weight.data() + begin;
      if (std::all_of(weight, weight + count, [](double w) { return w <= 0; })) continue;
      if (!view.gather_shaded(rays.from(begin), count, zone, lobe_sums(s.open, count),
                              lobe_sums(s.shaded, count))) {
        continue;
      }
      for (std::size_t i = 0; i < count; ++i) shade_patch(i, begin + i, s);
    }
  });
}

/// The same for one patch: `i` in the chunk's sums, `patch` of all.
void FastModel::shade_patch(std::size_t i, std::size_t patch, Scratch& s) {
  double& weight = s.patches.weight[patch];
  double& path = s.patches.first[patch];
  double& square = s.patches.second[patch];
  if (weight <= 0) return;
  const double share = s.open.weight[i] > 0 ? s.shaded.weight[i] / s.open.weight[i] : 0.0;
  if (share < kNoShare) {
    weight = path = square = 0;
    return;
  }
  const double open_mean = s.open.first[i] / s.open.weight[i];
  const double mean = s.shaded.first[i] / s.shaded.weight[i];
  const double spread = (s.shaded.second[i] / s.shaded.weight[i] - mean * mean) -
                        (s.open.second[i] / s.open.weight[i] - open_mean * open_mean);
  const double before = path / weight;
  const double after = before + (mean - open_mean);
  const double variance = std::max(square / weight - before * before + spread, 0.0);
  weight *= share;
  path = weight * after;
  square = weight * (after * after + variance);
}

namespace {

/// Shares of a parallelogram's edges that are left when a straight edge moves its middle by
/// `shift`.
std::array<double, 2> edges_left(const Vector3d& shift, const Vector3d& u, const Vector3d& v) {
  const double uu = u.squaredNorm(), vv = v.squaredNorm(), uv = u.dot(v);
  const double det = uu * vv - uv * uv;
  if (!(det > 0)) return {1, 1};
  const double a = (vv * shift.dot(u) - uv * shift.dot(v)) / det;
  const double b = (uu * shift.dot(v) - uv * shift.dot(u)) / det;
  return {std::max(1 - std::abs(a), 0.0), std::max(1 - std::abs(b), 0.0)};
}

}  // namespace

/// Patches as a node sees them.
void FastModel::see_ends(const SurfacePoint& node, const PatchArrays& a, const ShadowView* shadows,
                         const CellNodes& cell, Scratch& s, LobeEnds& ends) const {
  light_between(node, a, shadows, s);
  const auto count = static_cast<std::size_t>(a.size());
  s.left_u.assign(count, 1.0);
  s.left_v.assign(count, 1.0);
  s.from_x.resize(count);
  s.from_y.resize(count);
  s.from_z.resize(count);
  s.distance.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    // A node of a rule stands for its part of the cell, the middle of which is elsewhere.
    s.from_x[i] = a.ax[i] - a.x[i];
    s.from_y[i] = a.ay[i] - a.y[i];
    s.from_z[i] = a.az[i] - a.z[i];
    s.distance[i] = s.path[i] - a.leg[i];
  }
  for (const auto& [patch, part] : s.partial) {
    const auto i = static_cast<int>(patch);
    const auto left = edges_left(part.shift, a.half_u(i), a.half_v(i));
    s.left_u[patch] = left[0];
    s.left_v[patch] = left[1];
    // The outer leg of the part that is seen.
    const Vector3d middle = part.shift + (1 - part.fraction) * (a.area_center(i) - a.center(i));
    s.distance[patch] -= a.leg_direction(i).dot(middle);
    for (auto* v : {&s.from_x, &s.from_y, &s.from_z}) (*v)[patch] *= part.fraction;
  }
  ends.fill({s.weight.data(), s.cosine.data(), s.path.data(),   s.distance.data(), s.dx.data(),
             s.dy.data(),     s.dz.data(),     a.lx.data(),     a.ly.data(),       a.lz.data(),
             a.ux.data(),     a.uy.data(),     a.uz.data(),     a.vx.data(),       a.vy.data(),
             a.vz.data(),     s.left_u.data(), s.left_v.data(), s.from_x.data(),   s.from_y.data(),
             s.from_z.data()},
            a.group_end, a.group_zone, node.normal, cell.half_u, cell.half_v);
}

/// Pairs of a lit and a seen patch.
void FastModel::retro_pairs(const CellNodes& cell, const Shadows& shadows, Scratch& s) const {
  const LobePairs pairs(std::get<RetroreflectiveMaterial>(scene_.hidden.material).lobe_sigma,
                        confocal_);
  for (std::size_t n = 0; n < cell.count; ++n) {
    const SurfacePoint& node = cell.nodes[n];
    const ShadowView* view = shadows.empty() ? nullptr : &shadows[n];
    see_ends(node, lit_, view, cell, s, s.lit_ends);
    see_ends(node, seen_, view, cell, s, s.seen_ends);
    pairs.visit(s.lit_ends, s.seen_ends, scene_.hidden.albedo * node.area, s.pulses,
                [&](int zone, const Pulses& pulses) {
                  s.pair_count += static_cast<double>(pulses.count);
                  add_pulses(s, zone, 0, pulses.count);
                });
  }
}

/// Occluders of this pose where they are not the plan's: all of them outside of the search region,
/// for which the plan was made, and the object itself when that term is switched on.
std::vector<OccluderFace> FastModel::own_occluders(const Placement& placement,
                                                   const Transform& T) const {
  std::vector<OccluderFace> faces;
  if (!overrides_.switched_off(Term::occlusion) && !in_search_region(scene_, placement)) {
    faces = all_occluders_;
  }
  if (overrides_.switched_on(Term::self_shadowing)) {
    if (faces.empty()) faces = plan_.occluders;
    const std::vector<OccluderFace> body = body_faces(scene_.hidden.shape, T, placement.size);
    faces.insert(faces.end(), body.begin(), body.end());
  }
  return faces;
}

/// Object points one by one.
void FastModel::render_points(const Placement& placement, const Transform& T,
                              const std::vector<OccluderFace>& occluders,
                              const MovingBodies& bodies, Scratch& s) const {
  std::vector<OccluderFace> faces;
  for (const SurfacePoint& own : points_) {
    const SurfacePoint point{T * Vector3d(placement.size * own.center), T.linear() * own.normal,
                             placement.size * placement.size * own.area};
    if (!faces_relay(point.center, point.normal)) continue;
    if (occluders.empty() && bodies.empty()) {
      lambertian(point, nullptr, s);
      continue;
    }
    faces = occluders;
    bodies.faces_seen_from(point.center, faces);
    ShadowView shadows(faces, point.center);
    shadows.leave_out_clear_of(relay_.center_of_all, relay_.radius_of_all);
    lambertian(point, shadows.empty() ? nullptr : &shadows, s);
  }
}

/// Object cells one by one, each with its nodes.
void FastModel::render_cells(const Placement& placement, const Transform& T,
                             const std::vector<OccluderFace>& occluders, const MovingBodies& bodies,
                             Scratch& s) const {
  Shadows shadows;
  std::vector<std::vector<OccluderFace>> faces;  // in the way of each node, the same or its own
  const std::vector<SurfaceCell> cells =
      divide(scene_.hidden.shape, T, placement.size, object_edge_, 1);
  std::vector<SurfacePoint> anchors;
  const bool lobes = single_sum() && lobe_;
  if (lobes) {
    anchors = anchors_of(cells);
    if (s.lobes.size() < anchors_) s.lobes.resize(anchors_);
    for (LobeLight& light : s.lobes) light.known = false;
  }
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const SurfaceCell& cell = cells[c];
    if (!faces_relay(cell.center, cell.normal)) continue;
    const std::size_t anchor = lobes ? anchor_[c] : 0;
    if (lobes && !s.lobes[anchor].known) {
      gather(anchors[anchor], s.lobes[anchor], s);
    }
    const CellNodes nodes(cell, object_midpoint_);
    if (!occluders.empty() || !bodies.empty()) {
      shadows.clear();
      faces.clear();
      for (std::size_t n = 0; n < nodes.count; ++n) {
        const Vector3d& point = nodes.nodes[n].center;
        if (bodies.empty()) {
          shadows.emplace_back(occluders, point);
          continue;
        }
        faces.push_back(occluders);
        bodies.faces_seen_from(point, faces.back());
        shadows.emplace_back(faces.back(), point);
      }
    }
    if (plan_.kernel == Kernel::retro_pairs) {
      retro_pairs(nodes, shadows, s);
      continue;
    }
    retro_single(nodes, anchor, shadows,
                 bodies.empty() ? std::span<const std::vector<OccluderFace>>(&occluders, 1)
                                : std::span<const std::vector<OccluderFace>>(faces),
                 s);
  }
}

Scratch& FastModel::own_scratch() {
  thread_local Scratch scratch;
  return scratch;
}

void FastModel::render(const Placement& placement, const MovingBodies& bodies,
                       HistogramCube& out) const {
  const Sensor& sensor = scene_.sensor;
  if (out.rows != sensor.rows || out.columns != sensor.columns || out.bins != sensor.bins) {
    out = HistogramCube(sensor.rows, sensor.columns, sensor.bins);
  } else {
    std::fill(out.values.begin(), out.values.end(), 0.0);
  }
  Scratch& scratch = own_scratch();
  scratch.pair_count = 0;
  const int zones = sensor.zone_count();
  const bool wraps = axis_bins_ != sensor.bins;
  if (wraps) {
    const auto axis = static_cast<std::size_t>(axis_bins_);
    scratch.unfolded.assign(static_cast<std::size_t>(zones) * axis, 0.0);
  }
  scratch.rows = wraps ? scratch.unfolded.data() : out.values.data();
  scratch.prepare(zones, path_cells_);

  const HiddenObject& hidden = scene_.hidden;
  const Transform T = object_to_world(hidden.shape, hidden.anchor, placement);
  const std::vector<OccluderFace> own = own_occluders(placement, T);
  const std::vector<OccluderFace>& occluders = own.empty() ? plan_.occluders : own;
  if (plan_.kernel == Kernel::lambertian) {
    render_points(placement, T, occluders, bodies, scratch);
  } else {
    render_cells(placement, T, occluders, bodies, scratch);
  }
  flush(scratch);
  for (int z = 0; wraps && z < zones; ++z) {
    fold(sensor, z, scratch.rows + static_cast<std::ptrdiff_t>(z) * axis_bins_, axis_bins_,
         out.zone(z));
  }
  mix_zones(sensor, out);
}

namespace {

/// Several hidden objects, or one that shadows itself: a model for each, with all bodies that are
/// in its way. Light that visits two objects has bounced four times and is left out.
class FastObjects final : public ForwardModel {
 public:
  FastObjects(const Scene& scene, const SensorPlacement& placement, const FastModelOptions& options)
      : scene_(scene) {
    FastModelOptions share = options;  // errors add up in a bin
    share.tolerance /= object_count(scene_);
    for (int i = 0; i < object_count(scene_); ++i) {
      parts_.push_back(std::make_unique<FastModel>(only_object(scene_, i), placement, share));
    }
    plan_ = parts_.front()->plan();
    for (std::size_t i = 1; i < parts_.size(); ++i) {
      join(parts_[i]->plan(), hidden_object(scene_, static_cast<int>(i)).name);
    }
    plan_.decide({Term::self_shadowing, "self-shadowing of the object", true,
                  object_count(scene_) > 1 ? "hidden objects may hide each other"
                                           : "the shape is not convex"});
  }

  using ForwardModel::three_bounce;
  void three_bounce(const PoseVector& pose, HistogramCube& out) const override {
    const std::vector<Placement> placements = placements_at(scene_, pose);
    out = HistogramCube(scene_.sensor.rows, scene_.sensor.columns, scene_.sensor.bins);
    thread_local HistogramCube light;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      MovingBodies bodies;
      for (std::size_t j = 0; j < parts_.size(); ++j) {
        const HiddenObject& other = hidden_object(scene_, static_cast<int>(j));
        if (i != j || !is_convex(other.shape)) bodies.add(other, placements[j]);
      }
      parts_[i]->render(placements[i], bodies, light);
      for (std::size_t k = 0; k < out.values.size(); ++k) out.values[k] += light.values[k];
    }
  }
  const HistogramCube& direct_return() const override { return parts_.front()->direct_return(); }
  const TransportPlan& plan() const override { return plan_; }
  /// The finest of any object: what suits it suits the others.
  std::optional<Fidelity> fidelity() const override {
    Fidelity finest = *parts_.front()->fidelity();
    for (const auto& part : parts_) {
      finest.relay = std::min(finest.relay, part->fidelity()->relay);
      finest.object = std::min(finest.object, part->fidelity()->object);
      finest.lobe_pairs = finest.lobe_pairs || part->fidelity()->lobe_pairs;
    }
    return finest;
  }

 private:
  /// What one object needs, the scene needs. No peak of the sum is below that of one object, so
  /// bounds add.
  void join(const TransportPlan& other, const std::string& name) {
    for (const OccluderFace& face : other.occluders) {
      const bool known = std::ranges::any_of(
          plan_.occluders, [&](const OccluderFace& f) { return f.corners == face.corners; });
      if (!known) plan_.occluders.push_back(face);
    }
    for (const PlanDecision& decision : other.decisions) {
      PlanDecision both = plan_.decision(decision.term);
      if (decision.reason != both.reason) both.reason += "; " + name + ": " + decision.reason;
      both.used = both.used || decision.used;
      both.bound += decision.bound;
      plan_.decide(both);
    }
  }

  Scene scene_;
  std::vector<std::unique_ptr<FastModel>> parts_;
  TransportPlan plan_;
};

}  // namespace

void FastModelOptions::validate() const {
  if (!(tolerance > 0 && tolerance < 1)) {
    throw Error("FastModelOptions.tolerance", "accepted: between 0 and 1");
  }
  if (!(extra_pulse_sigma >= 0)) {
    throw Error("FastModelOptions.extra_pulse_sigma", "accepted: at least 0 s");
  }
  if (fidelity && !(fidelity->relay > 0 && fidelity->object > 0)) {
    throw Error("FastModelOptions.fidelity", "accepted: both above 0");
  }
}

std::unique_ptr<ForwardModel> make_fast_model(const Scene& scene, const SensorPlacement& placement,
                                              const FastModelOptions& options) {
  options.validate();
  if (std::holds_alternative<MeasuredLawMaterial>(scene.hidden.material)) {
    return make_measured_law_model(scene, placement, options.extra_pulse_sigma);
  }
  if (object_count(scene) > 1 || !is_convex(scene.hidden.shape)) {
    return std::make_unique<FastObjects>(scene, placement, options);
  }
  return std::make_unique<FastModel>(scene, placement, options);
}

}  // namespace blindcorner
