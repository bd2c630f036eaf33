// SPDX-License-Identifier: Apache-2.0
/// Kernel for any BRDF: one pulse for each pair of a way in and a way out at every point of the
/// object. Relay and object are sampled by rules of points, as for a Lambertian object
/// (lambertian_kernel.cpp).
#include "blindcorner/forward/constants.h"
#include "forward/transport/transport_kernel.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

class BrdfKernel final : public TransportKernel {
 public:
  explicit BrdfKernel(const KernelInputs& inputs)
      : transport_(inputs.view.transport),
        sampling_(inputs.sampling),
        confocal_(inputs.view.confocal),
        extra_variance_(inputs.extra_variance),
        axis_bins_(unwrapped_bins(transport_->scene.sensor)),
        pulses_(transport_->pulses(extra_variance_, Kernel::brdf_pairs)) {
    const auto* material = std::get_if<BrdfMaterial>(&transport_->scene.hidden.material);
    if (material != nullptr) brdf_ = material->brdf;
  }

  void render(const ObjectInPlace& object, Scratch& s) const override {
    visit_points(*sampling_, object, [&](const SurfacePoint& point, const ShadowView* shadows) {
      light_between(point, sampling_->relay, shadows, s);
      add_pairs(point, s);
    });
  }

 private:
  void add_pairs(const SurfacePoint& point, Scratch& s) const {
    const Sensor& sensor = transport_->scene.sensor;
    const PatchArrays& relay = sampling_->relay;
    const double scale = transport_->scene.hidden.albedo * point.area;
    const double bins_per_metre = 1 / (kSpeedOfLight * sensor.bin_width);
    const std::size_t lit_sets = sampling_->lit.set_end.size();
    const auto direction = [&](std::size_t patch) {
      return Vector3d(s.dx[patch], s.dy[patch], s.dz[patch]);
    };
    for (std::size_t z = 0; z < sampling_->seen.set_end.size(); ++z) {
      const double start = sensor.zones[z].time_zero / sensor.bin_width;
      double* row = s.rows + static_cast<std::ptrdiff_t>(z) * axis_bins_;
      const auto [in_begin, in_end] = relay.set(confocal_ ? z : 0);
      const auto [out_begin, out_end] = relay.set(lit_sets + z);
      for (std::size_t r = out_begin; r < out_end; ++r) {
        if (s.weight[r] <= 0) continue;
        const Vector3d out = direction(r);
        for (std::size_t p = in_begin; p < in_end; ++p) {
          if (s.weight[p] <= 0) continue;
          const double reflected =
              brdf_ == nullptr ? 1 / kPi : brdf_->value(point.normal, direction(p), out);
          if (reflected <= 0) continue;
          pulses_->add(row, axis_bins_, start + (s.path[p] + s.path[r]) * bins_per_metre,
                       extra_variance_, scale * reflected * s.weight[p] * s.weight[r]);
        }
      }
    }
  }

  std::shared_ptr<const SceneTransport> transport_;
  std::shared_ptr<const Sampling> sampling_;
  bool confocal_;
  double extra_variance_;  ///< s^2
  int axis_bins_;
  std::shared_ptr<const PulseTable> pulses_;
  std::shared_ptr<const Brdf> brdf_;  ///< null: Lambertian
};

}  // namespace

std::unique_ptr<TransportKernel> make_brdf_kernel(const KernelInputs& inputs) {
  return std::make_unique<BrdfKernel>(inputs);
}

}  // namespace blindcorner
