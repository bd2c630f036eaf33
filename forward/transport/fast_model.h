// SPDX-License-Identifier: Apache-2.0
/// The fast model of one hidden object: a sampling of relay and object, and a kernel that sums over
/// it. Sums over light arriving and light leaving stand for pairs of paths where they can.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "blindcorner/forward/transport/forward_model.h"
#include "forward/relay/moving_bodies.h"
#include "forward/transport/sampling.h"
#include "forward/transport/static_background.h"
#include "forward/transport/transport_kernel.h"

namespace blindcorner {

/// A sampling step, and what the search for it learned.
struct FoundSampling {
  SamplingStep sampling_step;
  double unresolved = 0;     ///< change of a bin where the search gave up
  std::string pairs_reason;  ///< why pairs are summed, or are not
};

class FastModel final : public ForwardModel {
 public:
  /// `options.sampling_step` is ignored.
  FastModel(std::shared_ptr<const SensorView> view, const FastModelOptions& options,
            FoundSampling found);

  using ForwardModel::three_bounce;
  void three_bounce(const PoseVector& pose, HistogramCube& out) const override {
    render(place(scene_.hidden.placement, scene_.unknowns, pose), {}, out);
  }
  /// The same for a placement of the object, with other bodies in the way. Returns how many pairs
  /// of patches were looked at.
  double render(const Placement& placement, const MovingBodies& bodies, HistogramCube& out) const;
  const HistogramCube& static_background() const override;
  using ForwardModel::shadowed_background;
  HistogramCube shadowed_background(const PoseVector& pose, bool coarsely) const override {
    return background_behind(hidden_faces(scene_, pose), coarsely);
  }
  /// static_background() with these bodies in the way of the later bounces.
  HistogramCube background_behind(const std::vector<OccluderFace>& bodies, bool coarsely) const;
  BackgroundError background_error() const override;
  /// The plan's reasons are found on the first call.
  const TransportPlan& plan() const override;
  std::optional<SamplingStep> sampling_step() const override { return found_.sampling_step; }
  std::optional<ModelSize> size() const override {
    return ModelSize{sampling_->lit.size(), sampling_->seen.size(), sampling_->object_nodes};
  }
  Kernel kernel() const { return kernel_; }
  const Sampling& sampling() const { return *sampling_; }
  /// Largest change of a bin, as a share of the peak, when pairs of patches replace the single sum.
  double single_sum_bound() const;

 private:
  static Kernel kernel_for(const SensorView& view, const FastModelOptions& options,
                           const SamplingStep& sampling_step);
  std::vector<Eigen::Vector3d> relay_corners() const;
  void complete_plan() const;
  bool bounces() const;
  void decide_bounces() const;
  bool holds_known_light() const;
  std::pair<int, int> reachable_bins() const;
  std::vector<OccluderFace> own_occluders(const Placement& placement, const Transform& T) const;

  std::shared_ptr<const SensorView> view_;
  const Scene& scene_;
  const RelaySetup& setup_;
  FastModelOptions options_;
  FoundSampling found_;
  double extra_variance_;  ///< s^2
  double pulse_sigma_;     ///< m of path, pulse, bin and extra blur together
  int axis_bins_;
  Kernel kernel_;
  std::shared_ptr<const Sampling> sampling_;
  std::unique_ptr<TransportKernel> sum_;
  std::vector<OccluderFace> occluders_;  ///< of poses in the search region
  mutable std::once_flag plan_once_, direct_once_, open_once_, coarse_open_once_;
  mutable TransportPlan plan_;
  mutable HistogramCube direct_, first_bounce_;
  mutable HistogramCube open_, coarse_open_;  ///< later bounces without a body in their way
};

/// The coarsest sampling that meets `options.tolerance`. Pairs of patches replace one sum where
/// that changes a bin by more than `pairs_from`, as a share of the peak of this object's light.
FoundSampling find_sampling(const std::shared_ptr<const SensorView>& view,
                            const FastModelOptions& options, double pairs_from);

}  // namespace blindcorner
