// SPDX-License-Identifier: Apache-2.0
/// What nobody sees in a scene file or a result, in sentences that say what to do about it.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/inverse/fit.h"

namespace blindcorner {

/// How much of a search region no zone can see, as shares of its places (0 to 1).
struct RegionReach {
  double behind = 0;  ///< behind all of the relay that is lit and seen
  double early = 0;   ///< all light comes before the first bin that is used
  double late = 0;    ///< all light comes after the last bin that is used
  std::string relay;  ///< names of the relay surfaces that are lit and seen

  double unseen() const { return behind + early + late; }
};

/// Places on a lattice over the unknown coordinates of one object, from the geometry alone: what
/// known bodies hide is not looked at, nor what the object turns away from the relay.
RegionReach region_reach(const Scene& scene, const SensorPlacement& sensor, int object = 0);

/// The same of one placement of each object, the worst of them.
RegionReach placement_reach(const Scene& scene, const SensorPlacement& sensor,
                            const std::vector<Placement>& placements);

/// About a scene before there is a capture: parts of the search region in which nothing can be
/// found. Empty: nothing to say.
std::vector<std::string> scene_hints(const Scene& scene, const SensorPlacement& sensor);

/// About an object that is put somewhere on purpose.
std::vector<std::string> placement_hints(const Scene& scene, const SensorPlacement& sensor,
                                         const std::vector<Placement>& placements);

/// About a fit whose light the scene cannot have made, as when gains were never calibrated.
std::vector<std::string> fit_hints(const Scene& scene, const FitResult& result);

}  // namespace blindcorner
