// SPDX-License-Identifier: Apache-2.0
/// Parts that both models share: the relay patches that the sensor lights and sees, and the direct
/// return.
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

/// Patch of the relay surface with its radiometric weight and the path length of its outer leg.
struct WeightedPatch {
  RelayPatch patch;
  /// Lit: I dOmega rho / pi (W/sr). Seen: dOmega rho / pi (sr).
  double weight = 0.0;
  double leg = 0.0;                                         ///< m, outer leg's path length
  Eigen::Vector3d leg_direction = Eigen::Vector3d::Zero();  ///< gradient of the leg at the patch
  /// Radiance that a seen patch sends back under the source's light, W/m^2/sr. It is filled in only
  /// where the sampling asks for it.
  double radiance = 0.0;
};

/// The error to throw when a scene has a measured law and zones that are not relay points.
Error measured_law_without_points(const Scene& scene);

/// Acceleration structures over the known surfaces. They serve any sensor pose.
struct SurfaceRays {
  explicit SurfaceRays(const std::vector<Surface>& surfaces);
  RayScene all, occluders;
};

/// Cells of the direct return, each with two to five Gauss nodes along either side. With the
/// default cells, the light is within 1e-4 (L2) of that of {24, 0.2, 5} on the wall, the corridor,
/// the street and the reference floor. For a sensor that moves over the crossing, {4, 0.3, 5} errs
/// by 3e-5 to 1.5e-4. {4, 0.3, 2} leaves larger cells over the borders of surfaces and errs by 1e-4
/// to 1.3e-3.
struct DirectSampling {
  int divisions = 10;   ///< least number of cells along each side of a zone
  double spread = 0.3;  ///< path spread of two nodes relative to the pulse's standard deviation
  int edge_depth = 6;   ///< quarterings of a cell over the border of two surfaces
};

/// Geometry of one sensor placement, compiled for sampling. The scene must outlive it.
class RelaySetup {
 public:
  RelaySetup(const Scene& scene, const SensorPlacement& placement);
  RelaySetup(const Scene& scene, const SensorPlacement& placement,
             std::shared_ptr<const SurfaceRays> rays);

  /// Patches that the flash field lights, on relay surfaces or on all surfaces.
  std::vector<WeightedPatch> lit(const RelaySampling& sampling, bool relay_only = true) const;
  /// Patches that zone z sees.
  std::vector<WeightedPatch> seen(int zone, const RelaySampling& sampling,
                                  bool relay_only = true) const;
  /// Patches that zone z lights by itself (confocal).
  std::vector<WeightedPatch> lit_by_zone(int zone, const RelaySampling& sampling,
                                         bool relay_only = true) const;

  /// Radiance that a patch seen by the zone sends back under the source's light, W/m^2/sr.
  double radiance(int zone, const RelayPatch& patch) const;

  /// Direct return of all surfaces, W/m^2 per bin.
  HistogramCube direct_return(const PulseTable& pulses, const DirectSampling& cells) const;

  /// Relay points that span the lit and seen area, for the plan.
  std::vector<Eigen::Vector3d> relay_points() const;
  /// Points whose convex hull contains the whole space that the source lights and the zones see up
  /// to the known surfaces: both apexes, and the fields' corner directions down to the farthest
  /// surface.
  std::vector<Eigen::Vector3d> view_hull() const;
  /// Diameter of the lit spot, m.
  double lit_extent() const;

  /// Position of the detector, m.
  const Eigen::Vector3d& origin() const { return detector_; }
  /// Position of the light source, m.
  const Eigen::Vector3d& source() const { return source_; }
  /// Sum of solid angle times albedo over pi, sr, over all surfaces that zone z sees. Multiplied by
  /// the irradiance of an even light on the surfaces, it is the light that they send to the
  /// detector.
  double reflected_solid_angle(int zone) const;

  bool uses_points() const { return !placement_.relay_points.empty(); }
  const RayScene& surface_rays() const { return rays_->all; }  ///< all known surfaces
  const RayScene& occluder_rays() const { return rays_->occluders; }

 private:
  std::vector<WeightedPatch> region(const Eigen::Vector3d& origin, const FieldOfIllumination& field,
                                    const RelaySampling& sampling, bool relay_only) const;
  WeightedPatch point_patch(int zone) const;
  /// Name of the scene field or capture field that gave the zone's relay point.
  std::string point_field(int zone) const;
  /// Corrects the outer legs of seen patches when path lengths count from the relay. Such captures
  /// have twice the zone's own distance taken off, so that the way back becomes minus the distance.
  void take_off_direct_path(std::vector<WeightedPatch>& seen) const;
  /// Radiance that the patch sends back. The rim of the field is resolved within the patch.
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

/// Length, in bins, of the time axis on which light is collected before it wraps.
int unwrapped_bins(const Sensor& sensor);

/// Spills light between zones by the sensor's crosstalk. Where time zeros differ, the light of the
/// other zone is moved to the receiving zone's clock, linearly between bins.
void mix_zones(const Sensor& sensor, HistogramCube& cube);

/// Adds the light of an unwrapped row to the bins of a zone.
void fold(const Sensor& sensor, int zone, const double* unwrapped, int unwrapped_count,
          double* row);

}  // namespace blindcorner
