// SPDX-License-Identifier: Apache-2.0
/// How light gets to a hidden point and back, one pulse for each zone: what the classical baselines
/// know of the geometry.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "forward/relay/relay_setup.h"

namespace blindcorner {

/// Light of one zone by way of a hidden point that scatters alike in all directions.
struct PointPulse {
  double path = 0;      ///< m, mean of the whole path: sensor, relay, point, relay, sensor
  double variance = 0;  ///< m^2, of the path over the lit and the seen patches
  double weight = 0;    ///< W/m^2 up to a factor that all zones share; 0: no light
};

/// Geometry of one sensor placement. The scene must outlive it. Thread safe.
class RelayPaths {
 public:
  RelayPaths(const Scene& scene, const SensorPlacement& placement);

  /// Pulses [zones] by way of a point (m, world). With `shadows`, patches that known bodies hide
  /// from the point give no light, so that the pulses jump where a patch appears. Without
  /// `shadows`, the pulses are smooth in the point. Points behind the relay get no light.
  void pulses(const Eigen::Vector3d& point, bool shadows, std::vector<PointPulse>& out) const;

  /// One zone's pulse, without shadows.
  PointPulse pulse(int zone, const Eigen::Vector3d& point) const;

  /// Diameter of the lit spot, m.
  double lit_extent() const { return setup_.lit_extent(); }

 private:
  /// A patch of the relay as it is lit or seen.
  struct Patch {
    Eigen::Vector3d center, normal;
    double leg = 0;     ///< m, outside of the hidden scene
    double weight = 0;  ///< W/sr or sr
  };
  static std::vector<Patch> patches_of(const std::vector<WeightedPatch>& sampled);
  std::vector<Patch> returning(int zone, const RelaySampling& sampling) const;
  PointPulse end(const std::vector<Patch>& patches, const Eigen::Vector3d& point,
                 bool shadows) const;
  /// The part of the path up to the point, where all zones share it; none where each zone is lit by
  /// itself.
  PointPulse shared_light(const Eigen::Vector3d& point, bool shadows) const;
  /// The whole path, there and back.
  PointPulse whole(std::size_t zone, const Eigen::Vector3d& point, bool shadows,
                   const PointPulse& shared) const;

  RelaySetup setup_;
  /// Whether light comes back to where it fell (retroreflectors): each zone then has one end, which
  /// is passed twice.
  bool comes_back_;
  bool shadows_;                          ///< some body may cast one
  std::vector<std::vector<Patch>> lit_;   ///< [1], confocal [zones]; empty where light comes back
  std::vector<std::vector<Patch>> seen_;  ///< [zones]; empty for dead zones
};

}  // namespace blindcorner
