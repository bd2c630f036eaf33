// SPDX-License-Identifier: Apache-2.0
/// How light is carried by way of a hidden object: one type for each way, behind one interface.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "forward/relay/moving_bodies.h"
#include "forward/transport/sampling.h"

namespace blindcorner {

/// The object where it is rendered, and what stands in its way.
struct ObjectInPlace {
  const Placement& placement;
  Transform T_world_object;
  const std::vector<OccluderFace>& occluders;
  const MovingBodies& bodies;

  bool shaded() const { return !occluders.empty() || !bodies.empty(); }
};

/// What a kernel is made of.
struct KernelInputs {
  const SensorView& view;  ///< for as long as the kernel is made
  std::shared_ptr<const Sampling> sampling;
  double tolerance;
  double extra_variance;  ///< s^2, of the extra Gaussian pulse
  bool whole_axis;        ///< looks at times that no light can reach, too
};

/// Adds the object's light to the rows of a time axis before it wraps, [zone][bin] at s.rows.
/// Thread safe.
class TransportKernel {
 public:
  virtual ~TransportKernel() = default;
  virtual void render(const ObjectInPlace& object, Scratch& s) const = 0;
  /// Continues the reason why the plan's sum is what it is.
  virtual std::string detail() const { return {}; }
};

/// A Lambertian object: light arriving and light leaving are two sums, which are convolved.
std::unique_ptr<TransportKernel> make_lambertian_kernel(const KernelInputs& inputs);
/// Any BRDF, a Lambertian object's as well: a pulse for each pair of a way in and a way out.
std::unique_ptr<TransportKernel> make_brdf_kernel(const KernelInputs& inputs);
/// A narrow lobe: light comes back from about where it fell.
std::unique_ptr<TransportKernel> make_retro_single_kernel(const KernelInputs& inputs);
/// Any lobe: pairs of a lit and a seen patch within the lobe's reach.
std::unique_ptr<TransportKernel> make_retro_pairs_kernel(const KernelInputs& inputs);

/// Whether any seen patch may lie on the front side of an object point.
bool faces_relay(const Sampling& sampling, const Eigen::Vector3d& center,
                 const Eigen::Vector3d& normal);

/// Calls `visit` with each point of the object in place that may face the relay, and with what
/// hides the relay from it; null: nothing.
void visit_points(const Sampling& sampling, const ObjectInPlace& object,
                  const std::function<void(const SurfacePoint&, const ShadowView*)>& visit);

/// For reasons.
std::string two_digits(double value);

}  // namespace blindcorner
