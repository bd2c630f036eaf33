// SPDX-License-Identifier: Apache-2.0
/// How finely the fast model divides relay and object: the cheapest sampling that meets a
/// tolerance, by what finer ones would change.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "blindcorner/forward/constants.h"
#include "forward/transport/fast_model.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Gaussian closure: relative L2 error of leaving out a group's higher cumulants, 0.05 s^2 for a
/// path spread of s pulse variances.
constexpr double kClosureError = 0.05;
/// Two Gauss nodes along an edge e at distance r: relative error of weights like cos^4 / r^4 is
/// about 0.01 (e / r)^4.
constexpr double kQuadratureError = 0.01;
/// The centre alone: about 0.35 (e / r)^2.
constexpr double kMidpointError = 0.35;
/// Gauss-Legendre points a distance d apart in path (standard deviation of even light between
/// them) for which the error exp(-2 (n s / a)^2) is e: d = kRuleSpread s / sqrt(ln(1 / e)).
constexpr double kRuleSpread = 0.75;
/// The same for points seen an angle apart, against inverse squares: an angle over ln(1 / e). The
/// relay's error is as large for the directions along which no path changes, and there a point more
/// costs little; the object is small.
constexpr double kRelayRuleAngle = 0.5;
constexpr double kObjectRuleAngle = 1.8;
/// Most points along an edge of a relay cell; larger cells are halved, so that dim ones can do with
/// fewer points.
constexpr double kMostRulePoints = 8;
/// Quarterings of a cell that straddles a border; what is left of it is shared between the
/// surfaces, and deeper ones change no shipped scene's error by 1e-4 of the light.
constexpr int kEdgeDepth = 2;
/// Width of a relay patch in standard deviations of the lobe, as seen from the object.
constexpr double kLobePatch = 1.5;
/// Coarseness of sampling that is looked at, and the ratio from one to the next.
constexpr double kCoarsest = 5.657;
constexpr double kFinest = 0.45;
constexpr double kCoarsenessStep = 1.41421356;
/// The same for rules of points, whose error falls so fast that smaller steps pay.
constexpr double kRuleStep = 1.18920712;
constexpr double kRuleFinest = 0.3;
/// Most pairs of lit and seen patches that a lobe's model takes for an evaluation (about 0.2 s):
/// the search for a sampling ends there, whatever the tolerance.
constexpr double kMostPairs = 4e7;
/// Edge of what shares the lobes of its middle, in those for which a midpoint will do: lobes matter
/// at the edges of the light only.
constexpr double kAnchorEdge = 2;
/// Cosine between normals of cells on one side of the object.
constexpr double kSameSide = 0.9;

/// How bright parts of the relay are, judged over the probed placements: dim parts may be sampled
/// more coarsely, and what adds up to next to nothing is left out.
class Brightness {
 public:
  Brightness(std::vector<Vector3d> objects, bool twice)
      : objects_(std::move(objects)), twice_(twice) {}

  /// Light exchanged per solid angle of the patch, up to a constant.
  double density(const RelayPatch& patch) const {
    double sum = 0;
    for (const Vector3d& q : objects_) {
      const Vector3d way = q - patch.center;
      sum += std::max(way.dot(patch.normal), 0.0) / std::pow(way.norm(), 3);
    }
    return patch.albedo * sum / (twice_ ? patch.distance * patch.distance : 1.0);
  }

  void learn(const RelayPatch& patch) {
    cells_.push_back({density(patch), density(patch) * patch.solid_angle});
  }
  void finish() {
    std::sort(cells_.begin(), cells_.end());
    double sum = 0;
    for (auto& [density, light] : cells_) light = sum += light;
    for (auto& [density, light] : cells_) light /= std::max(sum, 1e-300);
  }
  /// Share of all light that comes from parts no brighter than this.
  double share_below(double density) const {
    const auto it = std::upper_bound(cells_.begin(), cells_.end(), std::pair(density, 2.0));
    return it == cells_.begin() ? 0.0 : std::prev(it)->second;
  }

 private:
  std::vector<Vector3d> objects_;
  bool twice_;
  std::vector<std::pair<double, double>> cells_;  // density, cumulative share
};

}  // namespace

/// Limits of sampling in units of those that the closed-form estimates give for the tolerance.
FastModel::Limits FastModel::limits(double tolerance, double coarseness) const {
  // Six axes share each limit: two each of what is lit, what is seen and the object.
  constexpr double kAxes = 6;
  Limits l;
  l.spread =
      coarseness * pulse_sigma_ * std::pow(tolerance / kClosureError, 0.25) / std::sqrt(kAxes);
  l.aspect = coarseness * std::pow(tolerance / kQuadratureError / kAxes, 0.25);
  l.midpoint = coarseness * std::sqrt(tolerance / kMidpointError);
  const double digits = std::log(1 / tolerance);
  l.rule_spread = coarseness * kRuleSpread * pulse_sigma_ / std::sqrt(digits);
  l.relay_angle = coarseness * kRelayRuleAngle / digits;
  l.object_angle = coarseness * kObjectRuleAngle / digits;
  if (plan_.kernel == Kernel::retro_pairs) {
    // A patch stands for a Gaussian within the lobe: it must not be wide against it.
    const double sigma = std::get<RetroreflectiveMaterial>(scene_.hidden.material).lobe_sigma;
    l.aspect = std::min(l.aspect, coarseness * kLobePatch * sigma);
  }
  return l;
}

/// The cheapest sampling that meets the tolerance: limits become stricter until going on to at
/// least twice as many cells would change no bin of any probed pose by more than the tolerance (of
/// the pose's peak). The error falls with the fourth power of a cell's edges, so the change is at
/// least three quarters of the coarser one's error. The object takes half of the tolerance at most,
/// the relay what that leaves. Returns the change of both.
double FastModel::choose_sampling(const std::vector<PoseVector>& poses, double tolerance) {
  const auto object = [&](double c) {
    sample_object(limits(tolerance, c));
    return object_nodes_;
  };
  const auto relay = [&](double c) {
    sample_relay(limits(tolerance, c), tolerance);
    return lit_.size() + seen_.size();
  };
  // Pairs err by the object's cells the same at a coarser relay.
  fidelity_.relay = plan_.kernel == Kernel::retro_pairs ? 4 : 2;
  relay(fidelity_.relay);
  object(kCoarsest);
  // Half of the time is left for a finer relay.
  while (too_many_pairs(0.5 * kMostPairs) && fidelity_.relay < kCoarsest) {
    fidelity_.relay *= kCoarsenessStep;
    relay(fidelity_.relay);
    object(kCoarsest);
  }
  const Choice chosen = coarsest(poses, 0.5 * tolerance, 0.5 * kMostPairs, object);
  fidelity_.object = chosen.coarseness;
  object(fidelity_.object);
  const double left = tolerance - std::min(chosen.change, 0.5 * tolerance);
  const auto resolved_relay = [&](double c) {
    const int cells = relay(c);
    return pairs_resolve_lobe(c, tolerance) ? cells : -1;
  };
  const Choice last = coarsest(poses, left, kMostPairs, resolved_relay);
  fidelity_.relay = last.coarseness;
  relay(fidelity_.relay);
  return chosen.change + last.change;
}

/// At the fidelity chosen.
void FastModel::sample(double tolerance) {
  sample_relay(limits(tolerance, fidelity_.relay), tolerance);
  sample_object(limits(tolerance, fidelity_.object));
}

/// Histograms of the poses; learns which share of all pairs of patches they look at.
std::vector<HistogramCube> FastModel::render_probes(const std::vector<PoseVector>& poses) {
  std::vector<HistogramCube> cubes;
  double pairs = 0;
  for (const PoseVector& pose : poses) {
    cubes.push_back(three_bounce(pose));
    pairs = std::max(pairs, own_scratch().pair_count);
  }
  if (plan_.kernel == Kernel::retro_pairs) near_share_ = pairs / std::max(pair_count(), 1.0);
  return cubes;
}

/// A sampling for the plan's kernel, and pairs instead of the single sum where that leaves out too
/// much.
void FastModel::choose_fidelity(const FastModelOptions& options) {
  if (options.fidelity) {
    fidelity_ = *options.fidelity;
    // Of several objects, some may have no lobe.
    const bool wanted = fidelity_.lobe_pairs && !overrides_.switched_off(Term::patch_pairs);
    if (wanted && single_sum() && lobe_) take_pairs("; pairs, as the fidelity given says");
    sample(options.tolerance);
    return;
  }
  const std::vector<PoseVector> poses = probe_poses();
  choose_sampling(poses, options.tolerance);
  if (single_sum() && lobe_ && !overrides_.switched_off(Term::patch_pairs)) {
    compare_with_pairs(poses, options.tolerance);
  }
}

/// Pairs of patches instead of the single sum.
void FastModel::take_pairs(const std::string& reason) {
  plan_.kernel = Kernel::retro_pairs;
  fidelity_.lobe_pairs = true;
  PlanDecision decision = plan_.decision(Term::patch_pairs);
  decision.used = true;
  decision.reason += reason;
  plan_.decide(decision);
}

/// Looks at what the single sum leaves out, first at a coarse sampling of pairs, and where that may
/// be more than the tolerance at one that meets it: takes pairs where it is.
void FastModel::compare_with_pairs(const std::vector<PoseVector>& poses, double tolerance) {
  constexpr Fidelity kCoarsePairs{4, kCoarsest, true};
  const Fidelity single = fidelity_;
  const TransportPlan plan = plan_;
  const double unresolved = unresolved_;
  if (single_sum_bound() < 0.5 * tolerance) return;
  const std::vector<HistogramCube> summed = render_probes(poses);

  fidelity_ = kCoarsePairs;
  take_pairs("");
  sample(tolerance);
  double change = largest_change(summed, render_probes(poses));
  if (change > tolerance) {
    unresolved_ = 0;
    // Of two errors that have nothing to do with each other, the sum's. What a search gave up on is
    // the change of a sampling with at most half of the cells that it took.
    const double own = std::max(choose_sampling(poses, tolerance), 0.5 * unresolved_);
    const double both = largest_change(summed, render_probes(poses));
    change = std::sqrt(std::max(both * both - own * own, 0.0));
  }
  plan_ = plan;
  if (change > tolerance) {
    take_pairs("; one sum would change a bin by " + two_digits(change));
    return;
  }
  PlanDecision decision = plan_.decision(Term::patch_pairs);
  decision.reason += "; pairs would change a bin by no more than the tolerance";
  plan_.decide(decision);
  fidelity_ = single;
  unresolved_ = unresolved;
  sample(tolerance);
}

/// Whether pairs see an even relay as even. A row of normal distributions, each as wide as a patch
/// of edge w and the lobe together, has ripples of 2 exp(-2 pi^2 (sigma^2 + w^2 / 12) / w^2); each
/// seen patch and object point sees another phase of them.
bool FastModel::pairs_resolve_lobe(double coarseness, double tolerance) const {
  if (plan_.kernel != Kernel::retro_pairs) return true;
  const double edge = coarseness * kLobePatch;  // in units of the lobe
  const double ripple = 2 * std::exp(-2 * kPi * kPi * (1 / (edge * edge) + 1.0 / 12));
  const auto seen = static_cast<double>(seen_.group_end.size()) / scene_.sensor.zone_count();
  return ripple < tolerance * std::sqrt(std::max(seen * object_nodes_, 1.0));
}

/// Whether pairs of patches, where they are needed, would take too long.
bool FastModel::too_many_pairs(double most) const {
  return plan_.kernel == Kernel::retro_pairs && near_share_ * pair_count() > most;
}

/// Whether paths of light that arrives differ by so little that their mean will do: without their
/// variance a pulse's peak errs by half of it over the pulse's own. Of every lit set and probed
/// placement.
bool FastModel::arrives_at_once(double tolerance) const {
  const double pulse = std::pow(kSpeedOfLight * scene_.sensor.response.core_sigma(), 2);
  RelaySampling coarse;
  coarse.divisions = 4;
  coarse.edge_depth = 2;
  std::vector<std::vector<WeightedPatch>> sets;
  if (confocal_) {
    for (int z = 0; z < scene_.sensor.zone_count(); ++z) {
      if (scene_.sensor.zones[static_cast<std::size_t>(z)].dead) continue;
      sets.push_back(setup_.lit_by_zone(z, coarse));
    }
  } else {
    sets.push_back(setup_.lit(coarse));
  }
  for (const Placement& p : probe_placements(scene_)) {
    const Vector3d q = object_to_world(scene_.hidden.shape, scene_.hidden.anchor, p).translation();
    for (const std::vector<WeightedPatch>& set : sets) {
      double weight = 0, first = 0, second = 0;
      for (const WeightedPatch& patch : set) {
        const Vector3d way = patch.patch.center - q;
        const double path = patch.leg + way.norm();
        const Vector3d gradient = patch.leg_direction + way.normalized();
        const double variance = (std::pow(gradient.dot(patch.patch.half_u), 2) +
                                 std::pow(gradient.dot(patch.patch.half_v), 2)) /
                                3;
        weight += patch.weight;
        first += patch.weight * path;
        second += patch.weight * (path * path + variance);
      }
      if (weight <= 0) continue;
      const double variance = second / weight - std::pow(first / weight, 2);
      if (0.5 * variance > PathGrid::kShare * tolerance * pulse) return false;
    }
  }
  return true;
}

/// `sample` takes a coarseness and returns how many cells it made, -1 if they are too coarse to
/// be looked at.
FastModel::Choice FastModel::coarsest(const std::vector<PoseVector>& poses, double tolerance,
                                      double most_pairs, const std::function<int(double)>& sample) {
  // Borders of surfaces and shadows converge slowly: below this, finer cells that gain next to
  // nothing are not worth their time.
  constexpr double kStagnates = 0.05;
  struct Candidate {
    double coarseness;
    int cells;
    std::vector<HistogramCube> cubes;
  };
  std::vector<Candidate> candidates;
  const bool rules = plan_.kernel == Kernel::lambertian;
  std::vector<double> changes;  // [candidate] to at least twice as many cells
  double last_skipped = 0;      // coarseness
  const double step = rules ? kRuleStep : kCoarsenessStep;
  for (double c = kCoarsest; c > (rules ? kRuleFinest : kFinest); c /= step) {
    const int cells = sample(c);
    const bool first = candidates.empty() && last_skipped == 0;
    if (!first && too_many_pairs(most_pairs)) break;
    if (cells < 0) {
      last_skipped = c;
      continue;
    }
    if (!candidates.empty() && candidates.back().cells == cells) continue;
    candidates.push_back({c, cells, render_probes(poses)});
    const Candidate& fine = candidates.back();
    while (changes.size() + 1 < candidates.size()) {
      const Candidate& coarse = candidates[changes.size()];
      if (fine.cells < 2 * coarse.cells) break;
      const double change = largest_change(coarse.cubes, fine.cubes);
      if (change < tolerance) return {coarse.coarseness, change};
      const double before =
          changes.empty() ? std::numeric_limits<double>::infinity() : changes.back();
      changes.push_back(change);
      if (!rules && change < kStagnates && change > 0.8 * before) {
        unresolved_ += change;
        return {coarse.coarseness, change};
      }
    }
  }
  if (!changes.empty()) unresolved_ += changes.back();
  if (candidates.empty()) {
    unresolved_ += tolerance;
    return {last_skipped, tolerance};
  }
  return {candidates.back().coarseness, tolerance};
}

/// Poses at which errors are estimated: a low-discrepancy sequence in the search region.
std::vector<PoseVector> FastModel::probe_poses() const {
  constexpr int kPoses = 8;
  constexpr std::array<int, 6> kPrimes{2, 3, 5, 7, 11, 13};
  std::vector<PoseVector> poses;
  for (int i = 0; i < (scene_.unknowns.empty() ? 1 : kPoses); ++i) {
    PoseVector pose(static_cast<Eigen::Index>(scene_.unknowns.size()));
    for (std::size_t k = 0; k < scene_.unknowns.size(); ++k) {
      // Radical inverse (Halton).
      const int base = kPrimes[k % kPrimes.size()];
      double t = 0;
      double digit = 1.0 / base;
      for (int n = i + 1; n > 0; n /= base, digit /= base) t += digit * (n % base);
      pose[static_cast<Eigen::Index>(k)] =
          scene_.unknowns[k].lower + t * scene_.unknowns[k].range();
    }
    poses.push_back(pose);
  }
  return poses;
}

/// Largest change of a bin, relative to the peak of its pose; poses that give next to no light do
/// not count.
double FastModel::largest_change(const std::vector<HistogramCube>& coarse,
                                 const std::vector<HistogramCube>& fine) {
  constexpr double kDark = 1e-3;
  std::vector<double> peaks;
  for (const HistogramCube& cube : fine) {
    peaks.push_back(*std::max_element(cube.values.begin(), cube.values.end()));
  }
  const double brightest = *std::max_element(peaks.begin(), peaks.end());
  double largest = 0;
  for (std::size_t i = 0; i < fine.size(); ++i) {
    if (peaks[i] <= kDark * brightest) continue;
    for (std::size_t k = 0; k < fine[i].values.size(); ++k) {
      largest = std::max(largest, std::abs(coarse[i].values[k] - fine[i].values[k]) / peaks[i]);
    }
  }
  return largest;
}

/// Divides what is lit and seen until cells meet both limits in the root mean square over the
/// probed placements: a bound for the typical pose, not for the one that touches the relay. Parts
/// below which a share C of the light comes may be (0.5 / C)^0.15 coarser: their closure error
/// grows with the fourth power, and the sum of share times error stays within a factor of two.
/// Where rules of points do, cells are divided as little as borders of surfaces and dim parts ask
/// for, and have as many points along each edge as they exceed the limits.
void FastModel::sample_relay(const Limits& limits, double tolerance) {
  lit_ = {};
  seen_ = {};
  relay_ = {};
  std::vector<Vector3d> objects;
  for (const Placement& p : probe_placements(scene_)) {
    objects.push_back(object_to_world(scene_.hidden.shape, scene_.hidden.anchor, p).translation());
  }
  const Vector3d origin = setup_.origin();
  const bool single = plan_.kernel == Kernel::retro_single;
  const bool rules = plan_.kernel == Kernel::lambertian;
  const bool pairs = plan_.kernel == Kernel::retro_pairs;
  // How far a patch is beyond the limits along half_u and half_v.
  const auto excess = [&](const RelayPatch& patch, const Brightness& brightness) {
    const double below = std::max(brightness.share_below(brightness.density(patch)), 1e-6);
    const double relaxed = std::max(1.0, std::pow(0.5 / below, 0.15));
    double path_u = 0, path_v = 0, angle_u = 0, angle_v = 0;
    for (const Vector3d& q : objects) {
      const Vector3d way = patch.center - q;
      const Vector3d g =
          (single ? 2 : 1) * (way.normalized() + (patch.center - origin).normalized());
      path_u += std::pow(g.dot(patch.half_u), 2) / 3;
      path_v += std::pow(g.dot(patch.half_v), 2) / 3;
      angle_u += 4 * patch.half_u.squaredNorm() / way.squaredNorm();
      angle_v += 4 * patch.half_v.squaredNorm() / way.squaredNorm();
    }
    const auto count = static_cast<double>(objects.size());
    const double spread = rules ? limits.rule_spread : limits.spread;
    const double angle = rules ? limits.relay_angle : limits.aspect;
    return std::array{
        std::max(std::sqrt(path_u / count) / spread, std::sqrt(angle_u / count) / angle) / relaxed,
        std::max(std::sqrt(path_v / count) / spread, std::sqrt(angle_v / count) / angle) / relaxed};
  };
  RelaySampling sampling;
  sampling.edge_depth = kEdgeDepth;
  const auto sample_by = [&](const Brightness& brightness) {
    sampling.split = [&](const RelayPatch& patch) {
      const double most = rules && patch.whole ? kMostRulePoints : 1.0;
      const auto [u, v] = excess(patch, brightness);
      if (std::max(u, v) <= most) return 0;
      return u >= v ? 1 : 2;
    };
    sampling.nodes = [&](const RelayPatch& patch) -> std::array<int, 2> {
      if (rules) {
        const auto [u, v] = excess(patch, brightness);
        return {std::max(static_cast<int>(std::ceil(u)), 1),
                std::max(static_cast<int>(std::ceil(v)), 1)};
      }
      const double edge = 2 * std::max(patch.half_u.norm(), patch.half_v.norm());
      const bool wide = std::any_of(objects.begin(), objects.end(), [&](const Vector3d& q) {
        return edge > limits.midpoint * (patch.center - q).norm();
      });
      return pairs || wide ? std::array{2, 2} : std::array{1, 1};
    };
  };
  // Dim parts that, with all that is up to twice as bright, hold less than this share are left out.
  // The margin is for cells dimmer than any of those whose light was learned.
  const double negligible =
      overrides_.switched_on(Term::dim_patches) ? 0.0 : kNegligible * tolerance;
  dim_patches_ = 0;
  const auto prune = [&](std::vector<WeightedPatch> patches, const Brightness& brightness) {
    dim_patches_ += static_cast<int>(std::erase_if(patches, [&](const WeightedPatch& p) {
      return brightness.share_below(2 * brightness.density(p.patch)) < negligible;
    }));
    return patches;
  };
  RelaySampling coarse;
  coarse.divisions = 5;
  coarse.edge_depth = 2;
  const int zones = scene_.sensor.zone_count();
  const auto dead = [&](int z) { return scene_.sensor.zones[static_cast<std::size_t>(z)].dead; };

  Brightness seen(objects, single);
  for (int z = 0; z < zones; ++z) {
    if (dead(z)) continue;
    for (const WeightedPatch& p : setup_.seen(z, coarse)) seen.learn(p.patch);
  }
  seen.finish();
  sample_by(seen);
  std::vector<std::vector<WeightedPatch>> lit_sets, seen_sets;
  for (int z = 0; z < zones; ++z) {
    seen_sets.emplace_back();
    if (confocal_ && !single) lit_sets.emplace_back();
    if (!dead(z)) seen_sets.back() = prune(setup_.seen(z, sampling), seen);
    if (!dead(z) && confocal_ && !single) lit_sets.back() = setup_.lit_by_zone(z, sampling);
  }
  if (!confocal_ && !single) {
    Brightness lit(objects, false);
    coarse.divisions = 12;
    for (const WeightedPatch& p : setup_.lit(coarse)) lit.learn(p.patch);
    lit.finish();
    sample_by(lit);
    lit_sets.push_back(prune(setup_.lit(sampling), lit));
  }
  const auto fill = [](PatchArrays& arrays, const std::vector<std::vector<WeightedPatch>>& sets,
                       bool by_zone) {
    for (std::size_t i = 0; i < sets.size(); ++i) {
      arrays.append(sets[i], by_zone ? static_cast<int>(i) : -1);
    }
  };
  fill(lit_, lit_sets, confocal_);
  fill(seen_, seen_sets, true);
  if (rules) {
    fill(relay_, lit_sets, confocal_);
    fill(relay_, seen_sets, true);
  }
  for (PatchArrays* arrays : {&lit_, &seen_, &relay_}) arrays->finish();
}

/// Divides the object until its cells meet both limits, cells weighted with the light that they
/// would exchange.
void FastModel::sample_object(const Limits& limits) {
  const double extent = 2 * bounding_radius(scene_.hidden.shape, Anchor::center);
  const int stride = std::max(1, seen_.size() / 64);
  double anchor_edge = 0;
  for (object_edge_ = extent; object_edge_ > extent / 64; object_edge_ /= 1.25) {
    double weight = 0;
    double path = 0;
    double angle = 0;
    for (const Placement& p : probe_placements(scene_)) {
      const Transform T = object_to_world(scene_.hidden.shape, scene_.hidden.anchor, p);
      for (const SurfaceCell& cell : divide(scene_.hidden.shape, T, p.size, object_edge_, 1)) {
        for (int i = 0; i < seen_.size(); i += stride) {
          const Vector3d way = seen_.center(i) - cell.center;
          const double r = way.norm();
          const double cosine = way.dot(cell.normal) / r;
          if (cosine <= 0) continue;
          const double w = cosine * cosine * cell.area / std::pow(r, 4);
          const double u = 2 * way.dot(cell.half_u) / r;
          const double v = 2 * way.dot(cell.half_v) / r;
          weight += w;
          path += w * std::max(u * u, v * v) / 3;
          angle += w * 4 * std::max(cell.half_u.squaredNorm(), cell.half_v.squaredNorm()) / (r * r);
        }
      }
    }
    if (weight <= 0) continue;
    object_midpoint_ = std::sqrt(angle / weight) <= limits.midpoint;
    anchor_edge = object_edge_ * kAnchorEdge * limits.midpoint / std::sqrt(angle / weight);
    const bool rules = plan_.kernel == Kernel::lambertian;
    if (std::sqrt(path / weight) <= (rules ? limits.rule_spread : limits.spread) &&
        std::sqrt(angle / weight) <= (rules ? limits.object_angle : limits.aspect)) {
      break;
    }
  }
  if (plan_.kernel == Kernel::lambertian) {
    points_ = quadrature(scene_.hidden.shape, object_edge_);
    object_nodes_ = static_cast<int>(points_.size());
    return;
  }
  const Transform T =
      object_to_world(scene_.hidden.shape, scene_.hidden.anchor, scene_.hidden.placement);
  const auto cells =
      divide(scene_.hidden.shape, T, scene_.hidden.placement.size, object_edge_, 1).size();
  object_nodes_ = static_cast<int>(cells) * (object_midpoint_ ? 1 : kNodes);
  if (single_sum() && lobe_) sample_anchors(anchor_edge);
}

/// What a lobe gathers about a patch changes slowly with the place on the object that it belongs to
/// (its footprint's size and shape, not its middle), so the middle of several cells will do for
/// them: the error is of second order in their extent over the distance.
void FastModel::sample_anchors(double edge) {
  const Transform own = Transform::Identity();
  const auto cells = divide(scene_.hidden.shape, own, 1.0, object_edge_, 1);
  const auto tiles = divide(scene_.hidden.shape, own, 1.0, std::max(edge, object_edge_), 1);
  anchor_.clear();
  anchors_ = tiles.size();
  for (const SurfaceCell& cell : cells) {
    const auto far = [&](const SurfaceCell& tile) {
      const bool turned = tile.normal.dot(cell.normal) < kSameSide;
      return std::make_pair(turned, (tile.center - cell.center).squaredNorm());
    };
    const auto nearest = std::ranges::min_element(tiles, {}, far);
    anchor_.push_back(static_cast<std::size_t>(nearest - tiles.begin()));
  }
}

/// Middles of the cells that share an anchor.
std::vector<SurfacePoint> FastModel::anchors_of(const std::vector<SurfaceCell>& cells) const {
  std::vector<SurfacePoint> anchors(anchors_, {Vector3d::Zero(), Vector3d::Zero(), 0.0});
  for (std::size_t c = 0; c < cells.size(); ++c) {
    SurfacePoint& anchor = anchors[anchor_[c]];
    anchor.center += cells[c].area * cells[c].center;
    anchor.normal += cells[c].area * cells[c].normal;
    anchor.area += cells[c].area;
  }
  for (SurfacePoint& anchor : anchors) {
    if (anchor.area > 0) anchor.center /= anchor.area;
    anchor.normal.normalize();
  }
  return anchors;
}

}  // namespace blindcorner
