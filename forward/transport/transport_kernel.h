// SPDX-License-Identifier: Apache-2.0
/// How light travels by way of a hidden object: one kernel for each kind of sum, behind one
/// interface.
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
  const SensorView& view;  ///< needed only while the kernel is made
  std::shared_ptr<const Sampling> sampling;
  double tolerance;
  double extra_variance;  ///< s^2, of the extra Gaussian pulse
  bool whole_axis;        ///< also looks at times that no light can reach
};

/// Adds the object's light to the rows of the time axis before it wraps: s.rows, [zone][bin].
/// Thread safe.
class TransportKernel {
 public:
  virtual ~TransportKernel() = default;
  virtual void render(const ObjectInPlace& object, Scratch& s) const = 0;
  /// Details of the sum, appended to the plan's reason for it.
  virtual std::string detail() const { return {}; }
};

/// A Lambertian object: light arriving and light leaving are two sums, which are convolved.
std::unique_ptr<TransportKernel> make_lambertian_kernel(const KernelInputs& inputs);
/// Any BRDF, also a Lambertian one: a pulse for each pair of a way in and a way out.
std::unique_ptr<TransportKernel> make_brdf_kernel(const KernelInputs& inputs);
/// A narrow lobe: light goes back to about the relay point that it came from.
std::unique_ptr<TransportKernel> make_retro_single_kernel(const KernelInputs& inputs);
/// Any lobe: pairs of a lit and a seen patch within the lobe's reach.
std::unique_ptr<TransportKernel> make_retro_pairs_kernel(const KernelInputs& inputs);

/// Whether any seen patch may lie on the front side of an object point.
bool faces_relay(const Sampling& sampling, const Eigen::Vector3d& center,
                 const Eigen::Vector3d& normal);

/// Calls `visit` with each point of the placed object that may face the relay, and with the shadows
/// that hide parts of the relay from this point (null: none).
void visit_points(const Sampling& sampling, const ObjectInPlace& object,
                  const std::function<void(const SurfacePoint&, const ShadowView*)>& visit);

/// The value with two significant digits, for reasons of the plan.
std::string two_digits(double value);

}  // namespace blindcorner
