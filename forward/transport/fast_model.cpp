// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/fast_model.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "forward/relay/relay.h"
#include "forward/transport/measured_law_model.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Largest change of a bin when dim patches are left out, in units of the tolerance. The patches'
/// shares are means over the probed placements, and a pose near the dim patches sees more of them.
constexpr double kDimBound = 0.3;

std::unique_ptr<TransportKernel> make_kernel(Kernel kernel, bool all_pairs,
                                             const KernelInputs& inputs) {
  switch (kernel) {
    case Kernel::lambertian:
      return all_pairs ? make_brdf_kernel(inputs) : make_lambertian_kernel(inputs);
    case Kernel::brdf_pairs:
      return make_brdf_kernel(inputs);
    case Kernel::retro_single:
      return make_retro_single_kernel(inputs);
    case Kernel::retro_pairs:
      break;
  }
  return make_retro_pairs_kernel(inputs);
}

Scratch& own_scratch() {
  thread_local Scratch scratch;
  return scratch;
}

}  // namespace

std::string two_digits(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2g", value);
  return text;
}

bool faces_relay(const Sampling& sampling, const Vector3d& center, const Vector3d& normal) {
  return std::ranges::any_of(sampling.seen.blocks, [&](const PatchArrays::Block& block) {
    return normal.dot(block.center - center) > -block.radius;
  });
}

void visit_points(const Sampling& sampling, const ObjectInPlace& object,
                  const std::function<void(const SurfacePoint&, const ShadowView*)>& visit) {
  const double size = object.placement.size;
  for (const SurfacePoint& own : sampling.points) {
    const SurfacePoint point{object.T_world_object * Vector3d(size * own.center),
                             object.T_world_object.linear() * own.normal, size * size * own.area};
    if (!faces_relay(sampling, point.center, point.normal)) continue;
    if (!object.shaded()) {
      visit(point, nullptr);
      continue;
    }
    ShadowView shadows(object.occluders, point.center);
    object.bodies.cast(point.center, shadows);
    shadows.leave_out_clear_of(sampling.relay.center_of_all, sampling.relay.radius_of_all);
    visit(point, shadows.empty() ? nullptr : &shadows);
  }
}

/// The view's kernel. Pairs replace the single sum if `sampling_step` asks for them, unless the
/// relay consists of points, which have no lobe, or the term is switched off.
Kernel FastModel::kernel_for(const SensorView& view, const FastModelOptions& options,
                             const SamplingStep& sampling_step) {
  const bool pairs = view.kernel == Kernel::retro_single && sampling_step.lobe_pairs &&
                     !view.setup.uses_points() &&
                     !options.overrides.switched_off(Term::patch_pairs);
  return pairs ? Kernel::retro_pairs : view.kernel;
}

FastModel::FastModel(std::shared_ptr<const SensorView> view, const FastModelOptions& options,
                     FoundSampling found)
    : view_(std::move(view)),
      scene_(view_->transport->scene),
      setup_(view_->setup),
      options_(options),
      found_(std::move(found)),
      extra_variance_(options.extra_pulse_sigma * options.extra_pulse_sigma),
      pulse_sigma_(view_->transport->pulse_sigma(extra_variance_)),
      axis_bins_(unwrapped_bins(scene_.sensor)),
      kernel_(kernel_for(*view_, options, found_.sampling_step)),
      sampling_(std::make_shared<Sampling>(sample(
          *view_,
          {kernel_, found_.sampling_step, options.tolerance, pulse_sigma_,
           kernel_ == Kernel::brdf_pairs || options.overrides.switched_on(Term::dim_patches)}))),
      sum_(make_kernel(kernel_, options.overrides.switched_on(Term::patch_pairs),
                       {*view_, sampling_, options.tolerance, extra_variance_,
                        options.overrides.switched_on(Term::whole_axis)})) {
  if (options.overrides.switched_on(Term::occlusion)) {
    occluders_ = view_->transport->occluders;
  } else if (!options.overrides.switched_off(Term::occlusion)) {
    occluders_ = occluders_between(scene_, view_->transport->occluders, relay_corners());
  }
}

/// Corners of the convex hulls of all lit and seen patches, one hull per plane. The convex hull of
/// these points is that of all patches.
std::vector<Vector3d> FastModel::relay_corners() const {
  struct Plane {
    Vector3d normal;
    double offset;
    std::vector<Vector3d> points;
  };
  std::vector<Plane> planes;
  for (const PatchArrays* a : {&sampling_->lit, &sampling_->seen}) {
    for (int i = 0; i < a->size(); ++i) {
      const Vector3d center = a->area_center(i);
      const Vector3d normal = a->normal(i);
      // Directions equal to 1e-5 and offsets equal to 0.1 mm mean one surface, except for rounding.
      auto plane = std::ranges::find_if(planes, [&](const Plane& p) {
        return (p.normal - normal).squaredNorm() < 1e-10 &&
               std::abs(p.normal.dot(center) - p.offset) < 1e-4;
      });
      if (plane == planes.end()) plane = planes.insert(plane, {normal, normal.dot(center), {}});
      for (const double u : {-1.0, 1.0}) {
        for (const double v : {-1.0, 1.0}) {
          plane->points.push_back(center + u * a->half_u(i) + v * a->half_v(i));
        }
      }
    }
  }
  std::vector<Vector3d> corners;
  for (Plane& plane : planes) {
    // Lower and upper chain of the points in order of one axis (Andrew 1979).
    const auto axes = surface_axes(plane.normal);
    const Vector3d &x = axes.first, &y = axes.second;
    std::ranges::sort(plane.points, {}, [&](const Vector3d& p) { return x.dot(p); });
    for (const double side : {1.0, -1.0}) {
      const std::size_t first = corners.size();
      for (const Vector3d& p : plane.points) {
        const auto turns_out = [&] {
          const Vector3d a = corners.back() - corners[corners.size() - 2], b = p - corners.back();
          return side * (x.dot(a) * y.dot(b) - y.dot(a) * x.dot(b)) <= 0;
        };
        while (corners.size() > first + 1 && turns_out()) corners.pop_back();
        corners.push_back(p);
      }
    }
  }
  return corners;
}

const TransportPlan& FastModel::plan() const {
  std::call_once(plan_once_, [this] { complete_plan(); });
  return plan_;
}

/// Makes the decisions that need the sampled relay.
void FastModel::complete_plan() const {
  const double tolerance = options_.tolerance;
  plan_ = make_plan(scene_, relay_corners(), view_->lit_extent, options_.overrides);
  plan_.kernel = kernel_;
  plan_.occluders = occluders_;
  decide_view(plan_, scene_, setup_.view_hull());

  PlanDecision dim{Term::dim_patches, "dim relay patches", false, "", kDimBound * tolerance};
  dim.reason =
      std::to_string(sampling_->dim_patches) + " of " +
      std::to_string(sampling_->dim_patches + sampling_->lit.size() + sampling_->seen.size()) +
      " relay patches exchange less than " + two_digits(kNegligible * tolerance) +
      " of the light with the search region";
  if (kernel_ == Kernel::brdf_pairs) {
    dim.used = true;
    dim.reason = "the object may send more light there than a matt one";
  }
  plan_.decide(dim);
  PlanDecision pairs = plan_.decision(Term::patch_pairs);
  pairs.reason += found_.pairs_reason + sum_->detail();
  if (by_rules(kernel_)) {
    pairs.bound = tolerance;
  } else {
    // Pairs also divide the relay by the lobe. The error of coarser patches is the search's last
    // change, and as much again for the changes that would follow.
    pairs.used = pairs.used || kernel_ != view_->kernel;
    pairs.bound = single_sum_bound() + std::max(tolerance, 2 * found_.unresolved);
  }
  plan_.decide(pairs);
  const auto [first, last] = reachable_bins();
  plan_.decide({Term::whole_axis, "bins that no light can reach", false,
                "light from the search region arrives in bins " + std::to_string(first) + " to " +
                    std::to_string(last) + " of " + std::to_string(axis_bins_)});
  const bool direct = scene_.linear.direct != LinearMode::fixed || scene_.linear.fixed_direct > 0;
  std::string reason = direct ? "captures hold it: computed once, it does not depend on the pose"
                              : "captures hold none";
  if (scene_.sensor.has_background()) reason += "; measured background comes on top";
  plan_.decide({Term::direct_return, "direct return of the known surfaces", direct, reason});
  decide_bounces();
}

namespace {

/// Error of representing the light that a lobe gathers on the tilted relay by one pulse, relative
/// to the pulse's peak. The pulse has the right mean and the variance of two points of the lobe.
///
/// The lobe is turned by z standard deviations along the tilt (angle t off the normal, lobe s,
/// distance r). It then meets the relay at a distance x = r s z / cos t (1 + s tan t z + ...). The
/// path changes by a z + b z^2, with a = r s / cos t times the path's gradient and b = a s tan t.
/// The two points miss the variance 2 b^2, which lowers the peak of a pulse of width w by
/// b^2 / w^2. A Gaussian misses the third cumulant k = 6 a^2 b + 8 b^3, by
/// max |He3 phi| / phi(0) k / (6 w^3) = 0.23 k / w^3. An edge that cuts the lobe also makes it
/// lopsided: at most k = 0.22 a^3, as for a half normal distribution. Oblique edges that meet lose
/// 0.03 of the lobe at the corner.
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

/// Largest change of a bin, as a share of the peak, when pairs of patches replace the single sum.
/// It is the error from LobeClosure, averaged over each zone's light and relative to the brightest
/// zone's light, at the worst of the probed placements. Edges count with the share of a bin's light
/// that lies within a footprint on either side of two edges. A bin sees the share kBinShare of the
/// lit spot.
double FastModel::single_sum_bound() const {
  const auto* retro = std::get_if<RetroreflectiveMaterial>(&scene_.hidden.material);
  const PatchArrays& seen = sampling_->seen;
  const double extent = view_->lit_extent;
  if (retro == nullptr || extent <= 0) return 0.0;
  constexpr double kBinShare = 0.12;  // a pulse of 4 cm of path on a spot of 0.6 m: 0.07 to 0.3
  const double sigma = retro->lobe_sigma;
  double bound = 0;
  std::vector<double> light(scene_.sensor.zones.size());
  std::vector<double> lost(light.size());
  std::vector<double> radiance;
  for (int i = 0, group = 0; i < seen.size(); ++i) {
    while (i >= seen.group_end[static_cast<std::size_t>(group)]) ++group;
    RelayPatch patch;
    patch.center = seen.center(i);
    patch.normal = seen.normal(i);
    patch.half_u = seen.half_u(i);
    patch.half_v = seen.half_v(i);
    patch.area_center = seen.area_center(i);
    patch.albedo = seen.albedo[static_cast<std::size_t>(i)];
    radiance.push_back(setup_.radiance(seen.group_zone[static_cast<std::size_t>(group)], patch));
  }
  for (const Transform& T : view_->transport->T_world_probes) {
    const Vector3d q = T.translation();
    std::fill(light.begin(), light.end(), 0.0);
    std::fill(lost.begin(), lost.end(), 0.0);
    for (int i = 0, group = 0; i < seen.size(); ++i) {
      while (i >= seen.group_end[static_cast<std::size_t>(group)]) ++group;
      const Vector3d way = q - seen.center(i);
      const double r = way.norm();
      const Vector3d normal = seen.normal(i);
      const double cosine = std::max(way.dot(normal) / r, 0.5 * sigma);
      if (way.dot(normal) <= 0) continue;
      const auto k = static_cast<std::size_t>(i);
      const double weight = seen.weight[k] * radiance[k] * cosine / (r * r);
      // Direction along the tilt, on the relay.
      const Vector3d tilt = way / r - normal * way.dot(normal) / r;
      const double sine = tilt.norm();
      const Vector3d gradient = seen.leg_direction(i) - way / r;
      const double slope = sine > 0 ? std::abs(gradient.dot(tilt)) / sine : 0.0;
      const double footprint = sigma * r / cosine;
      const LobeClosure closure(footprint * slope, sigma * sine / cosine, pulse_sigma_);
      const double near_edges = std::min(4 * footprint / (kBinShare * extent), 1.0);
      const auto zone = static_cast<std::size_t>(seen.group_zone[static_cast<std::size_t>(group)]);
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

/// First and last bin of any zone that light from the search region can reach. They follow from the
/// shortest and longest paths through a ball around each probed placement.
std::pair<int, int> FastModel::reachable_bins() const {
  double square = 0;
  double radius = 0;
  for (const Unknown& unknown : scene_.unknowns) {
    if (unknown.component <= Component::z) square += std::pow(unknown.range() / 4, 2);
  }
  for (const Placement& p : view_->transport->probes) {
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
  for (const Transform& T : view_->transport->T_world_probes) {
    const Vector3d q = T.translation();
    const auto out = legs(sampling_->seen, q);
    const auto in = sampling_->lit.size() > 0 ? legs(sampling_->lit, q) : out;
    shortest = std::min(shortest, in.first + out.first);
    longest = std::max(longest, in.second + out.second);
  }
  if (!(shortest < longest)) return {0, -1};
  const auto [early, late] = std::ranges::minmax(scene_.sensor.zones, {}, &Zone::time_zero);
  const double bin = scene_.sensor.bin_width;
  const double bins_per_metre = 1 / (kSpeedOfLight * bin);
  const auto pulses = view_->transport->pulses(extra_variance_, view_->kernel);
  const int first = pulses->reach(early.time_zero / bin + shortest * bins_per_metre).first;
  const int end = pulses->reach(late.time_zero / bin + longest * bins_per_metre).second;
  return {std::clamp(first, 0, axis_bins_), std::clamp(end, 0, axis_bins_) - 1};
}

/// Computed on the first call, because models that only score never need it.
const HistogramCube& FastModel::static_background() const {
  std::call_once(direct_once_, [this] {
    const Sensor& sensor = scene_.sensor;
    direct_ = HistogramCube(sensor.rows, sensor.columns, sensor.bins);
    if (!holds_known_light()) return;
    direct_ = view_->transport->static_background()->light(setup_, options_.known_light, bounces(),
                                                           first_bounce_);
  });
  return direct_;
}

HistogramCube FastModel::background_behind(const std::vector<OccluderFace>& bodies,
                                           bool coarsely) const {
  if (!holds_known_light() || !bounces()) return static_background();
  const StaticBackgroundModel& known = *view_->transport->static_background();
  HistogramCube& open = coarsely ? coarse_open_ : open_;
  std::call_once(coarsely ? coarse_open_once_ : open_once_,
                 [&] { open = known.bounces_behind(setup_, {}, coarsely); });
  const HistogramCube shaded = known.bounces_behind(setup_, bodies, coarsely);
  HistogramCube light = static_background();
  for (std::size_t i = 0; i < light.values.size(); ++i) {
    light.values[i] = std::max(light.values[i] - (open.values[i] - shaded.values[i]), 0.0);
  }
  return light;
}

BackgroundError FastModel::background_error() const {
  if (!holds_known_light()) return {};
  const HistogramCube& light = static_background();
  return view_->transport->static_background()->error(light, first_bounce_, options_.known_light);
}

/// Whether captures hold light of the known scene.
bool FastModel::holds_known_light() const {
  return scene_.linear.direct != LinearMode::fixed || scene_.linear.fixed_direct > 0;
}

/// Whether light that bounces on within the known scene is included. It is left out only where
/// there is none, because its brightness beside an object does not tell how it compares with the
/// photon noise.
bool FastModel::bounces() const {
  return view_->transport->static_background()->any_bounces() && !setup_.uses_points() &&
         !options_.overrides.switched_off(Term::known_bounces);
}

void FastModel::decide_bounces() const {
  const bool held = holds_known_light();
  const bool used = held && bounces();
  plan_.decide({Term::known_bounces, "two and three bounces within the known scene", used,
                !held  ? "captures hold no light of the known scene"
                : used ? "reflecting surfaces face each other"
                       : "no two reflecting surfaces face each other"});
}

/// Occluders of this pose if they differ from the plan's, which holds for the search region.
/// Outside of the region, all occluders count. The object itself counts if that term is switched
/// on.
std::vector<OccluderFace> FastModel::own_occluders(const Placement& placement,
                                                   const Transform& T) const {
  std::vector<OccluderFace> faces;
  if (!options_.overrides.switched_off(Term::occlusion) && !in_search_region(scene_, placement)) {
    faces = view_->transport->occluders;
  }
  if (options_.overrides.switched_on(Term::self_shadowing)) {
    if (faces.empty()) faces = occluders_;
    const std::vector<OccluderFace> body = body_faces(scene_.hidden.shape, T, placement.size);
    faces.insert(faces.end(), body.begin(), body.end());
  }
  return faces;
}

double FastModel::render(const Placement& placement, const MovingBodies& bodies,
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
  const HiddenObject& hidden = scene_.hidden;
  const Transform T = object_to_world(hidden.shape, hidden.anchor, placement);
  const std::vector<OccluderFace> own = own_occluders(placement, T);
  sum_->render({placement, T, own.empty() ? occluders_ : own, bodies}, scratch);
  for (int z = 0; wraps && z < zones; ++z) {
    fold(sensor, z, scratch.rows + static_cast<std::ptrdiff_t>(z) * axis_bins_, axis_bins_,
         out.zone(z));
  }
  mix_zones(sensor, out);
  return scratch.pair_count;
}

namespace {

/// Divides the tolerance between the objects: sampling errors may fall anywhere, so the errors of
/// several objects add up in a bin. The error of a single sum is different, because it lies where
/// the lobe's light lies. Where two objects' light meets, their peaks meet as well, and the share
/// of the peak is that of the worse object. The need for pairs is therefore judged with the whole
/// tolerance. Otherwise a street with two lobes would take pairs, at a hundred times the time, for
/// an error below that allowed for one object alone.
FastModelOptions share_of(FastModelOptions options, const SceneTransport& all) {
  options.tolerance /= static_cast<double>(std::max<std::size_t>(all.objects.size(), 1));
  return options;
}

/// The sampling that is fine enough for both.
SamplingStep finer(const std::optional<SamplingStep>& a, const SamplingStep& b) {
  if (!a) return b;
  return {std::min(a->relay, b.relay), std::min(a->object, b.object),
          a->lobe_pairs || b.lobe_pairs};
}

std::unique_ptr<FastModel> make_part(const std::shared_ptr<const SceneTransport>& transport,
                                     const SensorPlacement& placement,
                                     const FastModelOptions& options, double pairs_from) {
  const auto view = std::make_shared<SensorView>(transport, placement, options.overrides);
  FoundSampling found;
  if (!options.sampling_step) {
    found = find_sampling(view, options, pairs_from);
  } else {
    found.sampling_step = *options.sampling_step;
    if (found.sampling_step.lobe_pairs) found.pairs_reason = "; pairs, as the sampling given says";
  }
  return std::make_unique<FastModel>(view, options, std::move(found));
}

/// Several hidden objects, or one that shadows itself. Each has its own model, which includes all
/// bodies in its way. Light that visits two objects has bounced four times and is left out.
class FastObjects final : public ForwardModel {
 public:
  FastObjects(std::shared_ptr<const SceneTransport> transport, const SensorPlacement& placement,
              const FastModelOptions& options)
      : transport_(std::move(transport)), scene_(transport_->scene) {
    for (const auto& object : transport_->objects) {
      parts_.push_back(
          make_part(object, placement, share_of(options, *transport_), options.tolerance));
    }
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
  const HistogramCube& static_background() const override {
    return parts_.front()->static_background();
  }
  using ForwardModel::shadowed_background;
  HistogramCube shadowed_background(const PoseVector& pose, bool coarsely) const override {
    return parts_.front()->background_behind(hidden_faces(scene_, pose), coarsely);
  }
  BackgroundError background_error() const override { return parts_.front()->background_error(); }
  const TransportPlan& plan() const override {
    std::call_once(plan_once_, [this] { join_plans(); });
    return plan_;
  }
  /// The finest sampling of any object, which is fine enough for all.
  std::optional<SamplingStep> sampling_step() const override {
    std::optional<SamplingStep> all;
    for (const auto& part : parts_) all = finer(all, *part->sampling_step());
    return all;
  }

 private:
  void join_plans() const {
    plan_ = parts_.front()->plan();
    for (std::size_t i = 1; i < parts_.size(); ++i) {
      join(parts_[i]->plan(), hidden_object(scene_, static_cast<int>(i)).name);
    }
    plan_.decide({Term::self_shadowing, "self-shadowing of the object", true,
                  object_count(scene_) > 1 ? "hidden objects may hide each other"
                                           : "the shape is not convex"});
  }
  /// Adds one object's plan to the scene's, which needs all that one object needs. No peak of the
  /// sum is below that of one object, so bounds add.
  void join(const TransportPlan& other, const std::string& name) const {
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

  std::shared_ptr<const SceneTransport> transport_;
  const Scene& scene_;
  std::vector<std::unique_ptr<FastModel>> parts_;
  mutable std::once_flag plan_once_;
  mutable TransportPlan plan_;
};

}  // namespace

void FastModelOptions::validate() const {
  if (!(tolerance >= kLeastTolerance && tolerance < 1)) {
    throw Error("FastModelOptions.tolerance", "accepted: 1e-5 to less than 1");
  }
  if (!(extra_pulse_sigma >= 0)) {
    throw Error("FastModelOptions.extra_pulse_sigma", "accepted: at least 0 s");
  }
  if (sampling_step && !(sampling_step->relay > 0 && sampling_step->object > 0)) {
    throw Error("FastModelOptions.sampling_step", "accepted: both above 0");
  }
}

std::unique_ptr<ForwardModel> make_fast_model(std::shared_ptr<const SceneTransport> transport,
                                              const SensorPlacement& placement,
                                              const FastModelOptions& options) {
  options.validate();
  if (std::holds_alternative<MeasuredLawMaterial>(transport->scene.hidden.material)) {
    return make_measured_law_model(transport->scene, placement, options.extra_pulse_sigma);
  }
  if (!transport->objects.empty()) {
    return std::make_unique<FastObjects>(std::move(transport), placement, options);
  }
  return make_part(transport, placement, options, options.tolerance);
}

std::unique_ptr<ForwardModel> make_fast_model(const Scene& scene, const SensorPlacement& placement,
                                              const FastModelOptions& options) {
  return make_fast_model(make_scene_transport(scene), placement, options);
}

std::optional<SamplingStep> choose_sampling(const std::shared_ptr<const SceneTransport>& transport,
                                            const SensorPlacement& placement,
                                            const FastModelOptions& options) {
  options.validate();
  if (std::holds_alternative<MeasuredLawMaterial>(transport->scene.hidden.material)) {
    return std::nullopt;
  }
  const auto find = [&](const std::shared_ptr<const SceneTransport>& object) {
    const auto view = std::make_shared<SensorView>(object, placement, options.overrides);
    return find_sampling(view, share_of(options, *transport), options.tolerance).sampling_step;
  };
  if (transport->objects.empty()) return find(transport);
  std::optional<SamplingStep> all;
  for (const auto& object : transport->objects) all = finer(all, find(object));
  return all;
}

}  // namespace blindcorner
