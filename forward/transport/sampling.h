// SPDX-License-Identifier: Apache-2.0
/// Which points of relay and object the fast model sums over.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "forward/relay/relay_setup.h"
#include "forward/transport/patch_light.h"
#include "forward/transport/scene_transport.h"

namespace blindcorner {

/// Share of the light, in units of the tolerance, below which dim patches are left out together. A
/// pose near them may see ten times as much of them and still meet kDimBound in fast_model.cpp.
constexpr double kNegligible = 0.03;

/// The relay as the sensor lights and sees it from one placement: a coarse look that serves any
/// sampling.
struct SensorView {
  SensorView(std::shared_ptr<const SceneTransport> of, const SensorPlacement& at,
             const PlanOverrides& overrides);

  std::shared_ptr<const SceneTransport> transport;
  SensorPlacement placement;
  RelaySetup setup;
  bool confocal;
  std::vector<RelayPatch> seen, lit;  ///< coarse; `lit` is empty for confocal sensors
  double lit_extent = 0;              ///< m, for retroreflectors only
  Kernel kernel;                      ///< that the material and the lit spot ask for

  bool dead(int zone) const {
    return transport->scene.sensor.zones[static_cast<std::size_t>(zone)].dead;
  }
};

/// Whether relay and object are sampled by rules of points, for light that changes slowly over
/// them.
inline bool by_rules(Kernel kernel) {
  return kernel == Kernel::lambertian || kernel == Kernel::brdf_pairs;
}

/// How finely to sample, and for which sum.
struct SamplingNeeds {
  Kernel kernel;
  SamplingStep sampling_step;
  double tolerance;
  double pulse_sigma;             ///< m of path
  bool keep_dim_patches = false;  ///< leaves no patches out
};

struct Sampling {
  PatchArrays lit;      ///< of the flash field, or of all zones one after the other (confocal)
  PatchArrays seen;     ///< of all zones, one after the other
  PatchArrays relay;    ///< lit patches, then seen ones (rules of points)
  int dim_patches = 0;  ///< left out

  int object_nodes = 0;              ///< of the scene's own placement
  std::vector<SurfacePoint> points;  ///< of a rule, in the object's own coordinates
  double object_edge = 1.0;          ///< m, of cells of a retroreflector
  bool object_midpoint = false;      ///< cells are so small that their centres will do
  /// [cell] the anchor whose lobes stand for the cell's own. Cells of one anchor are near each
  /// other and on one side of the object.
  std::vector<std::size_t> anchor;
  std::size_t anchors = 0;
};

Sampling sample(const SensorView& view, const SamplingNeeds& needs);

/// Width of a relay patch for pairs in standard deviations of the lobe, as seen from the object, at
/// coarseness 1: an even relay then has ripples of 3e-5 at most (resolves_lobe in
/// sampling_search.cpp).
constexpr double kLobePatch = 1.5;

}  // namespace blindcorner
