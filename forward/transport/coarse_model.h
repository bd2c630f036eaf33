// SPDX-License-Identifier: Apache-2.0
/// Three-bounce light in closed form: a few Gaussian pulses for each zone. A pose costs
/// microseconds, a sensor placement a millisecond; the light is right to some ten per cent. It
/// tells a search where to look, and its derivatives steer a fit whose residuals come from a better
/// model.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "forward/relay/relay_setup.h"
#include "forward/sensor/pulse_table.h"
#include "forward/transport/patch_light.h"

namespace blindcorner {

/// Flat pieces of a hidden object in its own coordinates, and the tabulated pulse: what no sensor
/// placement changes. The scene must outlive it.
class CoarseScene {
 public:
  explicit CoarseScene(const Scene& scene);

  struct Object {
    std::vector<SurfaceCell> cells;    ///< m, own coordinates at size 1
    double lobe_sigma = 0;             ///< rad; 0: not retroreflective
    std::shared_ptr<const Brdf> brdf;  ///< null: Lambertian or retroreflective
  };

  const Scene& scene;
  double pulse_path;  ///< m, standard deviation of pulse and bin as path
  PulseTable pulses;  ///< up to the widest pulse that a zone may need
  std::vector<Object> objects;
  std::vector<OccluderFace> occluders;
};

/// Light of some bins of every zone; the others are dark.
struct SparseLight {
  struct Range {
    int begin = 0, end = 0;
  };
  HistogramCube cube;      ///< W/m^2 per bin
  std::vector<Range> lit;  ///< [zones]
};

/// The closed-form light of one sensor placement. A run is a group of patches near each other: a
/// zone or one patch of it, or a part of the field. The object's middle sees a run as one: weight,
/// mean path and variance. Each piece of the object then makes one pulse for each run whose light
/// comes back to where it fell (narrow lobes), or for each pair of a run that lights it and a run
/// that sees it. Shadows of known bodies and of other hidden objects are continuous, and found for
/// the object's middle. An object's shadow on itself is left out. Thread safe.
class CoarseModel {
 public:
  CoarseModel(std::shared_ptr<const CoarseScene> shared, const SensorPlacement& placement);

  /// Adds `extra_pulse_sigma` (s) of Gaussian width to the pulse.
  void three_bounce(const PoseVector& pose, double extra_pulse_sigma, SparseLight& out) const {
    three_bounce(placements_at(shared_->scene, pose), extra_pulse_sigma, out);
  }
  /// The same for given placements. `only` is the one object that counts, alone and unshaded by the
  /// others; -1: all.
  void three_bounce(const std::vector<Placement>& placements, double extra_pulse_sigma,
                    SparseLight& out, int only = -1) const;

  /// Bins of each zone that light from the search region may reach, [zones]. The bounds follow from
  /// the shortest and the longest path between the zone's patches and the region, widest pulse
  /// included.
  std::vector<SparseLight::Range> reach() const;

 private:
  /// Consecutive patches that are taken together.
  struct Run {
    int begin, end;
    int zone;
  };
  /// A run as the object's middle sees it.
  struct End {
    double weight = 0;    ///< with the relay's cosine and 1/r^2, without the object's cosine
    double leg = 0;       ///< m, mean outer leg
    double distance = 0;  ///< m, mean inner leg
    double variance = 0;  ///< m^2, of the path (both legs' change) over the run
    double angle2 = 0;    ///< rad^2, variance of the direction per axis
    Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< to the run, unit
  };
  /// The runs as an object's middle sees them, kept while only yaw changes.
  struct View {
    std::vector<End> lit, seen;
  };

  std::vector<Run> seen_runs(double most_spread) const;
  void see(const Eigen::Vector3d& middle, const std::vector<OccluderFace>& occluders,
           const PatchArrays& patches, const std::vector<Run>& runs, bool comes_back,
           std::vector<End>& ends) const;
  void render(const SurfaceCell& cell, const Eigen::Vector3d& middle, const View& view,
              std::size_t object, double extra, SparseLight& out) const;
  void add(int zone, double path, double variance, double weight, double extra,
           SparseLight& out) const;

  std::shared_ptr<const CoarseScene> shared_;
  PatchArrays lit_, seen_;
  std::vector<Run> lit_runs_, seen_runs_;
  std::vector<bool> pairs_;  ///< [objects] light goes from lit to seen runs, else back to its own
  bool confocal_;
  double way_in_;     ///< 1: both outer legs count, 0: paths count from the relay
  std::uint64_t id_;  ///< marks the views that threads keep
};

}  // namespace blindcorner
