// SPDX-License-Identifier: Apache-2.0
/// Light that bounces twice or three times within the known scene: it reaches the sensor late, as
/// light from a hidden object does.
#pragma once

#include <optional>
#include <vector>

#include "blindcorner/forward/sensor/capture.h"
#include "forward/relay/relay_setup.h"
#include "forward/transport/pair_sum.h"

namespace blindcorner {

/// How finely the light between known surfaces is sampled: cells along each side, each of four
/// Gauss nodes.
struct StaticSampling {
  int zone_divisions = 2;
  int field_divisions = 8;
  /// Largest edge of a middle surface's cells in standard deviations of the pulse's path.
  double middle_edge = 1.0;
  int most_divisions = 64;  ///< of a middle surface's edge
};

/// The known scene's own two- and three-bounce returns: source, surface, surface, (surface,)
/// detector. More bounces are left out: each costs a factor of albedo times the share of the
/// hemisphere that the surfaces fill for each other.
class StaticBounces {
 public:
  StaticBounces(const Scene& scene, const RelaySetup& setup, const StaticSampling& sampling);

  /// Whether any two reflecting surfaces face each other.
  bool any() const { return any_; }

  /// Adds the returns to the cube, W/m^2 per bin; `bodies` block some of them (none: nullptr). All
  /// pairs were summed once; a call goes through those only that the bodies change.
  void add(const RayScene* bodies, HistogramCube& cube) const;

 private:
  struct Middle {
    int surface;
    SurfaceCell cell;
    double scattered;  ///< area times albedo over pi
  };
  /// Ways between a cell and patches without and with bodies, and the difference: legs that bodies
  /// change, once with their light taken away and once with what is left of it.
  struct Ways {
    std::vector<Leg> open, shaded, change;
  };
  std::vector<Leg> open_legs(const SurfaceCell& cell, const std::vector<WeightedPatch>& patches,
                             int surface) const;
  bool may_change(const SurfaceCell& cell, const std::vector<WeightedPatch>& patches, int surface,
                  const RayScene& bodies) const;
  Ways ways(const SurfaceCell& cell, const std::vector<WeightedPatch>& patches, int surface,
            const RayScene* bodies) const;
  void add_two(PairSum& sum, int zone) const;
  void add_three(PairSum& sum) const;
  void change_two(PairSum& sum, int zone, const RayScene& bodies) const;
  void change_three(PairSum& sum, const RayScene& bodies) const;
  const std::vector<WeightedPatch>& lit(int zone) const {
    return lit_[lit_.size() == 1 ? 0 : static_cast<std::size_t>(zone)];
  }

  const Scene& scene_;
  bool any_ = false;
  const RelaySetup& setup_;
  std::vector<std::vector<WeightedPatch>> lit_;   // one for all zones, or one each (confocal)
  std::vector<std::vector<WeightedPatch>> seen_;  // [zone]
  std::vector<Middle> middle_;                    // cells that other surfaces' light reaches
  std::optional<PairSum> open_;                   // what all send without bodies
};

}  // namespace blindcorner
