// SPDX-License-Identifier: Apache-2.0
/// For a point q of a Lambertian object, light arriving at q and light leaving q towards a zone are
/// two independent sums, so their path-length distributions convolve. Each is laid on a grid of
/// paths (path_grid.h). The pairs of all object points are summed there for each zone, and become
/// bins once. Gauss-Legendre rules sample relay and object: the integrand is smooth except at the
/// edges of shadows, so few points are enough. Over a stretch whose path changes by 2a, a rule of n
/// points has an error like exp(-2 (n s / a)^2), where s is the pulse's width, as long as it also
/// resolves the inverse squares.
#include <algorithm>
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "forward/transport/transport_kernel.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Whether the paths of light that arrives differ so little that their mean is enough, for every
/// lit set and probed placement. Without their variance, a pulse's peak errs by half the ratio of
/// this variance to the pulse's own. Each of the four cells along a side adds its own variance.
bool arrives_at_once(const SensorView& view, double tolerance) {
  const Scene& scene = view.transport->scene;
  const double pulse = std::pow(kSpeedOfLight * scene.sensor.response.core_sigma(), 2);
  RelaySampling coarse;
  coarse.divisions = 4;
  coarse.centers_only = true;
  std::vector<std::vector<WeightedPatch>> sets;
  if (view.confocal) {
    for (int z = 0; z < scene.sensor.zone_count(); ++z) {
      if (!view.dead(z)) sets.push_back(view.setup.lit_by_zone(z, coarse));
    }
  } else {
    sets.push_back(view.setup.lit(coarse));
  }
  for (const Transform& T : view.transport->T_world_probes) {
    const Vector3d q = T.translation();
    for (const std::vector<WeightedPatch>& set : sets) {
      double weight = 0, first = 0, second = 0;
      for (const WeightedPatch& patch : set) {
        const Vector3d way = patch.patch.center - q;
        const double distance = way.norm();
        const double path = patch.leg + distance;
        const Vector3d gradient = patch.leg_direction + way / distance;
        const double u = gradient.dot(patch.patch.half_u), v = gradient.dot(patch.patch.half_v);
        weight += patch.weight;
        first += patch.weight * path;
        second += patch.weight * (path * path + (u * u + v * v) / 3);
      }
      if (weight <= 0) continue;
      const double mean = first / weight;
      if (0.5 * (second / weight - mean * mean) > PathGrid::kShare * tolerance * pulse)
        return false;
    }
  }
  return true;
}

/// How far legs may reach back before path zero, m. Legs that are counted from the relay have the
/// way between relay and sensor taken off.
double way_back(const SensorView& view, const Sampling& sampling) {
  double longest = 0;
  if (view.transport->scene.sensor.path_origin == PathOrigin::sensor) return longest;
  for (const PatchArrays* patches : {&sampling.lit, &sampling.seen}) {
    for (int i = 0; i < patches->size(); ++i) {
      longest = std::max(longest, (patches->center(i) - view.setup.origin()).norm());
    }
  }
  return longest;
}

class LambertianKernel final : public TransportKernel {
 public:
  explicit LambertianKernel(const KernelInputs& inputs)
      : transport_(inputs.view.transport),
        sampling_(inputs.sampling),
        confocal_(inputs.view.confocal),
        one_arrival_(arrives_at_once(inputs.view, inputs.tolerance)),
        whole_axis_(inputs.whole_axis),
        extra_variance_(inputs.extra_variance),
        axis_bins_(unwrapped_bins(transport_->scene.sensor)),
        grid_(transport_->grid(one_arrival_ ? PathGrid::Paths::whole : PathGrid::Paths::legs,
                               extra_variance_, way_back(inputs.view, *sampling_),
                               inputs.tolerance)) {}

  void render(const ObjectInPlace& object, Scratch& s) const override {
    const int zones = transport_->scene.sensor.zone_count();
    s.prepare(zones, 0);
    visit_points(*sampling_, object, [&](const SurfacePoint& point, const ShadowView* shadows) {
      add_point(point, shadows, s);
    });
    for (int z = 0; z < zones; ++z) {
      PathLight& pairs = s.pairs[static_cast<std::size_t>(z)];
      if (whole_axis_) pairs.take_all();
      grid_->add_to_row(z, pairs, s.rows + static_cast<std::ptrdiff_t>(z) * axis_bins_);
      pairs.clear();
    }
  }

  std::string detail() const override {
    return std::string(one_arrival_ ? ", one of which arrives at once" : ", which are convolved") +
           " on a grid of paths with a step of " + two_digits(1e3 * grid_->step()) + " mm";
  }

 private:
  /// Light arriving at an object point, convolved with the light that leaves it to each zone.
  void add_point(const SurfacePoint& point, const ShadowView* shadows, Scratch& s) const {
    const PatchArrays& relay = sampling_->relay;
    const double scale = transport_->scene.hidden.albedo / kPi * point.area;
    exchange_paths(point, relay, s);
    shade_patches(point, relay, shadows, s);
    if (one_arrival_) return pair_with_one(scale, s);
    grid_->find_splines(s.path.data(), s.weight.data(), relay.size(), s.splines);
    const std::size_t lit_sets = sampling_->lit.set_end.size();
    const std::size_t zones = sampling_->seen.set_end.size();
    const auto lay = [&](std::size_t set, PathLight& light) {
      const auto [begin, end] = relay.set(set);
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

  /// The same if the light that arrives has one path: whole paths are laid, without a convolution.
  void pair_with_one(double scale, Scratch& s) const {
    const PatchArrays& relay = sampling_->relay;
    const std::size_t lit_sets = sampling_->lit.set_end.size();
    const std::size_t zones = sampling_->seen.set_end.size();
    const auto first = static_cast<std::size_t>(sampling_->lit.size());
    for (std::size_t set = 0; set < lit_sets; ++set) {
      double weight = 0, path = 0;
      const auto [in_begin, in_end] = relay.set(set);
      for (std::size_t p = in_begin; p < in_end; ++p) {
        weight += s.weight[p];
        path += s.weight[p] * s.path[p];
      }
      if (weight > 0) path /= weight;
      // A flash lights all zones, a confocal set only its own zone.
      const std::size_t begin = relay.set(lit_sets + (confocal_ ? set : 0)).first;
      const std::size_t end = relay.set(lit_sets + (confocal_ ? set : zones - 1)).second;
      for (std::size_t r = begin; r < end; ++r) {
        s.weight[r] *= scale * weight;
        s.path[r] += path;
      }
    }
    grid_->find_splines(s.path.data() + first, s.weight.data() + first, sampling_->seen.size(),
                        s.splines);
    for (std::size_t z = 0; z < zones; ++z) {
      const auto [begin, end] = relay.set(lit_sets + z);
      grid_->add(s.splines, begin - first, end - first, s.pairs[z]);
    }
  }

  std::shared_ptr<const SceneTransport> transport_;
  std::shared_ptr<const Sampling> sampling_;
  bool confocal_;
  bool one_arrival_;  ///< all light of a lit set reaches a point at once
  bool whole_axis_;
  double extra_variance_;  ///< s^2
  int axis_bins_;
  std::shared_ptr<const PathGrid> grid_;
};

}  // namespace

std::unique_ptr<TransportKernel> make_lambertian_kernel(const KernelInputs& inputs) {
  return std::make_unique<LambertianKernel>(inputs);
}

}  // namespace blindcorner
