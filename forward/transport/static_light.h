// SPDX-License-Identifier: Apache-2.0
/// The known scene's own light for the fast model: what a fit needs anew for each sensor pose.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/forward/transport/transport_plan.h"
#include "forward/relay/relay_setup.h"
#include "forward/relay/visibility.h"

namespace blindcorner {

/// How finely the light that bounces on within the known scene is sampled.
struct StaticLightSampling {
  int zone_divisions = 2;      ///< cells along each side of a zone
  int field_divisions = 8;     ///< cells along each side of the field
  double middle_angle = 0.35;  ///< edge of a middle cell against its distance to what it faces
  double middle_edge = 0.06;   ///< the same against the extent of its surface: largest
  double least_edge = 0.02;    ///< smallest, against the largest extent of any surface
  double patch_angle = 0.7;    ///< edge of a zone's or the field's cell against that distance
  double least_patch = 4;      ///< smallest such edge in standard deviations of the pulse's path
};

/// Expected light of the known scene, W/m^2 per bin, and how far off it may be.
struct StaticLight {
  HistogramCube light;
  HistogramCube error;  ///< standard deviation of the model's own error
};

/// Two and three bounces within the known scene, smooth in the sensor's pose. Patches of the known
/// surfaces send each other light whose paths spread over their extent, so that coarse patches give
/// no comb. What a middle cell gathers is one histogram, which each zone's patches then delay.
///
/// Once for a scene: the cells in the middle, and which faces can hide something. For a sensor
/// pose: the light's and the zones' patches.
class KnownBounces {
 public:
  explicit KnownBounces(const Scene& scene, const StaticLightSampling& sampling = {});

  /// Whether any two reflecting surfaces face each other.
  bool any() const { return !middle_.empty(); }
  /// Adds two and three bounces to the cube, W/m^2 per bin.
  void add(const RelaySetup& setup, HistogramCube& cube) const;

  struct Patches;  ///< side by side in memory
  struct Legs;     ///< from one point to patches
  /// A piece of a known surface.
  struct Piece {
    std::size_t surface;
    SurfaceCell cell;
  };

 private:
  struct Middle {
    SurfaceCell cell;
    double scattered;  ///< area times albedo over pi
    ShadowView shadows;
  };
  double distance(const Piece& piece) const;
  static void find_legs(const SurfaceCell& cell, const ShadowView& shadows, const Patches& patches,
                        Legs& legs);

  const Scene& scene_;
  StaticLightSampling sampling_;
  std::vector<OccluderFace> blockers_;
  std::vector<Piece> faces_;  // reflecting ones
  std::vector<Middle> middle_;
};

}  // namespace blindcorner
