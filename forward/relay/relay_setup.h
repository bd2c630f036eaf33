// SPDX-License-Identifier: Apache-2.0
/// Shared by both models: what the sensor lights and sees on the relay, and the direct return.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "forward/relay/relay.h"
#include "forward/sensor/pulse_table.h"

namespace blindcorner {

/// Patch of the relay with its radiometric weight and the path of its outer leg.
struct WeightedPatch {
  RelayPatch patch;
  /// Lit: I dOmega rho / pi (W/sr). Seen: dOmega rho / pi (sr).
  double weight = 0.0;
  double leg = 0.0;                                         ///< m, outer leg's path length
  Eigen::Vector3d leg_direction = Eigen::Vector3d::Zero();  ///< gradient of the leg at the patch
  /// Seen patches, where the sampling asks for it: radiance that the source makes the patch send
  /// back, W/m^2/sr.
  double radiance = 0.0;
};

/// What to throw when a measured law meets zones that are no relay points.
Error measured_law_without_points(const Scene& scene);

/// Acceleration structures over the known surfaces, wherever the sensor stands.
struct SurfaceRays {
  explicit SurfaceRays(const std::vector<Surface>& surfaces);
  RayScene all, occluders;
};

/// Cells of the direct return, each of two to five Gauss nodes along either side. By default their
/// light is within 1e-4 (L2) of that of {24, 0.2, 5} on the wall, the corridor, the street and the
/// reference floor. Of a sensor that moves over the crossing, {4, 0.3, 5} errs by 3e-5 to 1.5e-4;
/// {4, 0.3, 2}, which leaves larger cells over the borders of surfaces, by 1e-4 to 1.3e-3.
struct DirectSampling {
  int divisions = 10;   ///< cells along each side of a zone, at least
  double spread = 0.3;  ///< path spread of two nodes against the pulse's standard deviation
  int edge_depth = 6;   ///< quarterings of a cell over the border of two surfaces
};

/// Geometry of one sensor placement, compiled for sampling. The scene must outlive it.
class RelaySetup {
 public:
  RelaySetup(const Scene& scene, const SensorPlacement& placement);
  RelaySetup(const Scene& scene, const SensorPlacement& placement,
             std::shared_ptr<const SurfaceRays> rays);

  /// Patches that the flash field lights, of relay surfaces or of all.
  std::vector<WeightedPatch> lit(const RelaySampling& sampling, bool relay_only = true) const;
  /// Patches that zone z sees.
  std::vector<WeightedPatch> seen(int zone, const RelaySampling& sampling,
                                  bool relay_only = true) const;
  /// Patches that zone z lights by itself (confocal).
  std::vector<WeightedPatch> lit_by_zone(int zone, const RelaySampling& sampling,
                                         bool relay_only = true) const;

  /// Radiance that the source makes a patch seen by the zone send back, W/m^2/sr.
  double radiance(int zone, const RelayPatch& patch) const;

  /// Direct return of all surfaces, W/m^2 per bin.
  HistogramCube direct_return(const PulseTable& pulses, const DirectSampling& cells) const;

  /// Relay points that span what is lit and seen, for the plan.
  std::vector<Eigen::Vector3d> relay_points() const;
  /// Points whose convex hull holds all that the source lights and the zones see on the way to the
  /// known surfaces: both apexes, and the fields' corner directions down to the farthest surface.
  std::vector<Eigen::Vector3d> view_hull() const;
  /// Diameter of the lit spot, m.
  double lit_extent() const;

  /// Position of the detector, m.
  const Eigen::Vector3d& origin() const { return detector_; }
  /// Position of the light source, m.
  const Eigen::Vector3d& source() const { return source_; }
  /// What zone z sees of all surfaces, as solid angle times albedo over pi, sr: times the
  /// irradiance of an even light on them it is the light that they send to the detector.
  double reflected_solid_angle(int zone) const;

  bool uses_points() const { return !placement_.relay_points.empty(); }
  const RayScene& surface_rays() const { return rays_->all; }  ///< all known surfaces
  const RayScene& occluder_rays() const { return rays_->occluders; }

 private:
  std::vector<WeightedPatch> region(const Eigen::Vector3d& origin, const FieldOfIllumination& field,
                                    const RelaySampling& sampling, bool relay_only) const;
  WeightedPatch point_patch(int zone) const;
  /// Scene field or capture field that gave the zone's relay point.
  std::string point_field(int zone) const;
  /// Outer legs of seen patches when path lengths count from the relay: twice the zone's own
  /// distance has been taken off, which leaves minus the distance on the way back.
  void take_off_direct_path(std::vector<WeightedPatch>& seen) const;
  /// Radiance sent back by the patch, the rim of the field resolved within the patch.
  double radiance(const RelayPatch& patch, const FieldOfIllumination& field, double* leg,
                  int rim_points = 12) const;
  bool on_rim(const RelayPatch& patch, const FieldOfIllumination& field) const;
  const FieldOfIllumination& field_of_zone(int zone, FieldOfIllumination& storage) const;

  const Scene& scene_;
  SensorPlacement placement_;
  Eigen::Vector3d source_;
  Eigen::Vector3d detector_;
  std::shared_ptr<const SurfaceRays> rays_;
};

/// Length of the time axis in bins on which light is collected before it wraps.
int unwrapped_bins(const Sensor& sensor);

/// Spills light between zones by the sensor's crosstalk. Where time zeros differ, the light of the
/// other zone is moved to the receiving zone's clock, linearly between bins.
void mix_zones(const Sensor& sensor, HistogramCube& cube);

/// Adds the light of an unwrapped row to the bins of a zone.
void fold(const Sensor& sensor, int zone, const double* unwrapped, int unwrapped_count,
          double* row);

}  // namespace blindcorner
